// Values that stand at several places of the wire message.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/engine/fit/parameter_estimate.h"
#include "server/diagnosis/report/diagnosis.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

v1::Report::Verdict ToMessage(engine::Verdict verdict);
v1::DataReport::Kind ToMessage(DataKind kind);

// The objects that it names are those of the values.
v1::Scope ScopeMessage(engine::EffectScope scope, const std::vector<engine::ParameterEstimate>& parameters);

// Appends to `parameters` of a message.
void WriteParameters(const std::vector<engine::ParameterEstimate>& parameters,
                     google::protobuf::RepeatedPtrField<v1::ParameterValue>* messages);

void WriteQuality(const Quality& quality, v1::Quality* message);
void WriteSlice(const Slice& slice, v1::Slice* message);

}  // namespace touchstone::diagnosis::report
