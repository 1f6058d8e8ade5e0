#include "server/diagnosis/report/message/message_parts.h"

#include <algorithm>

namespace touchstone::diagnosis::report {

v1::Report::Verdict ToMessage(engine::Verdict verdict) {
  static_assert(static_cast<int>(engine::Verdict::kTooLittleData) == v1::Report::TOO_LITTLE_DATA);
  return static_cast<v1::Report::Verdict>(static_cast<int>(verdict));
}

v1::DataReport::Kind ToMessage(DataKind kind) {
  static_assert(static_cast<int>(DataKind::kDistributions) + 1 == v1::DataReport::DISTRIBUTIONS);
  return static_cast<v1::DataReport::Kind>(static_cast<int>(kind) + 1);
}

v1::Scope ScopeMessage(engine::EffectScope scope, const std::vector<engine::ParameterEstimate>& parameters) {
  v1::Scope message;
  message.set_kind(scope == engine::EffectScope::kObject ? v1::Scope::OBJECT : v1::Scope::RIG);
  for (const engine::ParameterEstimate& estimate : parameters)
    if (!estimate.object.empty() &&
        std::count(message.objects().begin(), message.objects().end(), estimate.object) == 0)
      message.add_objects(estimate.object);
  return message;
}

void WriteParameters(const std::vector<engine::ParameterEstimate>& parameters,
                     google::protobuf::RepeatedPtrField<v1::ParameterValue>* messages) {
  for (const engine::ParameterEstimate& estimate : parameters) {
    v1::ParameterValue* value = messages->Add();
    value->set_name(estimate.name);
    value->set_value(estimate.value);
    value->set_std_error(estimate.std_error);
    value->set_unit(estimate.unit);
    value->set_finger(estimate.entry);
    value->set_object(estimate.object);
    value->set_lower(estimate.lower);
    value->set_upper(estimate.upper);
    if (estimate.before) value->set_before(*estimate.before);
    for (const auto& [kind, std_error] : estimate.std_error_alone) {
      v1::ErrorAlone* alone = value->add_alone();
      alone->set_kind(kind == "touches" ? v1::DataReport::TOUCHES : v1::DataReport::PHOTOGRAPHS);
      alone->set_std_error(std_error);
    }
  }
}

void WriteQuality(const Quality& quality, v1::Quality* message) {
  message->set_rmse(quality.rmse);
  message->set_heldout_rmse(quality.heldout_rmse);
  message->set_lack_of_fit_p(quality.lack_of_fit_p);
}

void WriteSlice(const Slice& slice, v1::Slice* message) {
  message->set_slice(slice.conditions);
  message->set_count(static_cast<uint32_t>(slice.count));
  message->set_mean_residual(slice.mean_residual);
  message->set_share_of_excess_error(slice.share_of_excess_error);
  message->set_words(slice.words);
  message->set_rmse(slice.rmse);
}

}  // namespace touchstone::diagnosis::report
