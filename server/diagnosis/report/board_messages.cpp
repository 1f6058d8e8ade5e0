#include "server/diagnosis/report/board_messages.h"

#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/version.h"

namespace touchstone::diagnosis::report {
namespace {

v1::Report::Verdict BoardVerdict(selection::Verdict verdict) {
  switch (verdict) {
    case selection::Verdict::kAdequate:
      return v1::Report::ADEQUATE;
    case selection::Verdict::kMissingEffects:
      return v1::Report::MISSING_EFFECTS;
    case selection::Verdict::kUnexplained:
      return v1::Report::UNEXPLAINED;
    case selection::Verdict::kTooLittleData:
      return v1::Report::TOO_LITTLE_DATA;
    default:
      return v1::Report::VERDICT_UNSPECIFIED;
  }
}

std::string ErrorWords(const boards::BoardQuality& quality) {
  return absl::StrFormat("reprojection error %.4f px, %.4f px on left-out pictures", quality.rmse_px,
                         quality.heldout_rmse_px);
}

void WriteQuality(const boards::BoardQuality& from, v1::Quality* to) {
  to->set_rmse_px(from.rmse_px);
  to->set_heldout_rmse_px(from.heldout_rmse_px);
}

void WriteBoardStep(const boards::BoardStep& found, v1::Step* step) {
  step->set_effect(found.effect);
  for (const std::string& equivalent : found.equivalent) step->add_equivalent(equivalent);
  step->set_probability(found.probability);
  step->set_gain_nats(found.gain_nats);
  step->set_meaning(found.meaning);
  step->set_check_on_rig(found.check_on_rig);
  step->set_remedy(found.remedy);
  step->set_scope("rig");
  step->set_words(ErrorWords(found.quality));
  step->set_rmse_px(found.quality.rmse_px);
  step->set_heldout_rmse_px(found.quality.heldout_rmse_px);
  for (const inference::ParameterEstimate& estimate : found.parameters) {
    v1::ParameterValue* value = step->add_parameters();
    value->set_name(estimate.name);
    value->set_value(estimate.value);
    value->set_std_error(estimate.std_error);
    value->set_unit(estimate.unit);
    value->set_finger(estimate.entry);
    value->set_lower(estimate.lower);
    value->set_upper(estimate.upper);
  }
}

}  // namespace

v1::Report WriteBoardReport(const boards::BoardSet& set, const boards::BoardDiagnosis& diagnosis) {
  v1::Report report;
  report.set_verdict(BoardVerdict(diagnosis.verdict));
  report.set_images(static_cast<uint32_t>(diagnosis.pictures));
  report.set_model_name(diagnosis.model_name);
  report.set_model_hash(diagnosis.model_hash);
  report.set_summary(diagnosis.summary);
  for (const std::string& warning : diagnosis.warnings) report.add_warnings(warning);
  if (diagnosis.initial) WriteQuality(*diagnosis.initial, report.mutable_initial());
  if (diagnosis.final) {
    WriteQuality(*diagnosis.final, report.mutable_final());
    // There are no repeats of a corner: what the best lens leaves is an upper bound. An error has two coordinates.
    report.mutable_noise_floor()->set_sigma_px(diagnosis.final->rmse_px / std::sqrt(2.0));
  }
  for (const boards::BoardStep& step : diagnosis.steps) WriteBoardStep(step, report.add_steps());
  if (!diagnosis.rest.empty()) {
    std::vector<std::string> words;
    for (const boards::BoardRest& rest : diagnosis.rest)
      words.push_back(absl::StrCat(rest.name, ": ", ErrorWords(rest.quality)));
    report.mutable_unexplained()->set_words(absl::StrJoin(words, "; "));
  }
  report.set_improved_model_yaml(diagnosis.improved_model_yaml);
  report.set_improved_model_hash(diagnosis.improved_model_hash);
  v1::DataSummary* data = report.mutable_data();
  data->set_rows(static_cast<uint32_t>(set.pictures.size() + set.without_board.size()));
  data->set_poses(static_cast<uint32_t>(set.pictures.size()));
  data->set_origin(set.origin);
  if (!set.without_board.empty()) {
    v1::UnusedRows* unused = data->add_unused();
    unused->set_rows(static_cast<uint32_t>(set.without_board.size()));
    unused->set_reason("the whole board is not in the picture");
  }
  report.set_version(kVersion);
  report.set_duration_s(diagnosis.duration_s);
  return report;
}

}  // namespace touchstone::diagnosis::report
