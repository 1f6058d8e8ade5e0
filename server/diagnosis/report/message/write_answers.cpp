#include "server/diagnosis/report/message/write_answers.h"

#include <absl/strings/strip.h>

#include "server/base/units.h"
#include "server/diagnosis/report/kinds/from_touches.h"
#include "server/diagnosis/report/message/message_parts.h"
#include "server/diagnosis/report/message/rules.h"

namespace touchstone::diagnosis::report {
namespace {

void WriteDeciding(const std::vector<residuals::DecidingTouch>& touches,
                   const std::vector<std::string>& fingers,
                   google::protobuf::RepeatedPtrField<v1::DecidingMeasurement>* messages) {
  for (const residuals::DecidingTouch& touch : touches) {
    v1::DecidingMeasurement* message = messages->Add();
    message->set_touch(touch.touch);
    message->set_object(touch.object);
    message->set_fall(touch.fall);
    message->set_finger(fingers[touch.finger]);
    message->set_before(Microseconds(touch.before_s));
    message->set_after(Microseconds(touch.after_s));
  }
}

}  // namespace

void WriteDetectable(const engine::DetectableValue& value, v1::DetectableEffect* message) {
  const model::ParameterInfo& parameter = value.effect->parameters[value.parameter];
  message->set_effect(value.effect->name);
  message->set_parameter(parameter.name);
  message->set_unit(std::string(UnitSymbol(parameter.unit)));
  message->set_finger(value.entry);
  message->set_stage(model::StageName(value.effect->stage));
  message->set_std_error(value.std_error);
  message->set_typical(value.typical);
  message->set_power_at_typical(value.power_at_typical);
  if (value.found_from) message->set_found_from(*value.found_from);
  message->set_rival(value.rival);
  message->set_correlation(value.correlation);
  if (value.told_from) message->set_told_from(*value.told_from);
  const bool told_at_once =
      value.told_from && *value.told_from <= kMessageRules.told_at_once * *value.found_from;
  if (!value.rival.empty() && value.found_from && !told_at_once)
    message->set_parted_by(engine::DeclaredMeasurement(
        value.effect->name, std::string(absl::StripPrefix(value.rival, engine::kGivenPrefix))));
}

void WriteExplanation(const ReportedExplanation& explained, const std::vector<std::string>& fingers,
                      v1::ExplainedEffect* message) {
  message->set_effect(explained.found.effect);
  WriteParameters(explained.found.parameters, message->mutable_parameters());
  message->set_gain_nats(explained.found.gain_nats);
  message->set_probability(explained.found.probability);
  message->set_rmse(explained.quality.rmse);
  message->set_heldout_rmse(explained.quality.heldout_rmse);
  for (const engine::TakenOver& taken : explained.found.taken_over) {
    v1::TakenOver* to = message->add_taken_over();
    to->set_effect(taken.effect);
    to->set_share(taken.share);
    to->set_gain_nats(taken.gain_nats);
  }
  WriteDeciding(explained.speak_for, fingers, message->mutable_speak_for());
  WriteDeciding(explained.speak_against, fingers, message->mutable_speak_against());
  message->set_words(explained.words);
}

void WriteVersus(const Versus& versus, const std::vector<std::string>& fingers,
                 v1::ModelComparison* message) {
  const residuals::ModelDifference& difference = versus.difference;
  message->set_other_name(versus.other_name);
  message->set_other_hash(versus.other_hash);
  WriteQuality(versus.other, message->mutable_other());
  message->set_rmse_difference(Microseconds(difference.difference_s));
  message->set_lower(Microseconds(difference.lower_s));
  message->set_upper(Microseconds(difference.upper_s));
  message->set_other_better(difference.other_better);
  for (const residuals::ErrorSlice& slice : difference.better)
    WriteSlice(SliceOf(slice), message->add_better());
  for (const residuals::ErrorSlice& slice : difference.worse)
    WriteSlice(SliceOf(slice), message->add_worse());
  WriteDeciding(difference.deciding, fingers, message->mutable_deciding());
  message->set_words(versus.words);
}

}  // namespace touchstone::diagnosis::report
