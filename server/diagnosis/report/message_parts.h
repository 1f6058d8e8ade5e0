// Pieces of messages that reports of touches and of photographs share.
#pragma once

#include <vector>

#include "server/diagnosis/selection/result.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

v1::Report::Verdict ToMessage(selection::Verdict verdict);
const char* ToMessage(selection::EffectScope scope);
const char* ToMessage(selection::CandidateNote note);

template <typename Message>
void WriteParameters(const std::vector<inference::ParameterEstimate>& parameters, Message* message) {
  for (const inference::ParameterEstimate& estimate : parameters) {
    v1::ParameterValue* value = message->add_parameters();
    value->set_name(estimate.name);
    value->set_value(estimate.value);
    value->set_std_error(estimate.std_error);
    value->set_unit(estimate.unit);
    value->set_finger(estimate.entry);
    value->set_object(estimate.object);
    value->set_lower(estimate.lower);
    value->set_upper(estimate.upper);
    if (estimate.before) value->set_before(*estimate.before);
    if (estimate.std_error_touches) value->set_std_error_touches(*estimate.std_error_touches);
    if (estimate.std_error_photographs) value->set_std_error_photographs(*estimate.std_error_photographs);
  }
}

}  // namespace touchstone::diagnosis::report
