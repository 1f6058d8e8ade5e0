#include "server/diagnosis/report/board_messages.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/version.h"
#include "server/diagnosis/report/message_parts.h"

namespace touchstone::diagnosis::report {
namespace {

std::string ErrorWords(const boards::BoardQuality& quality) {
  return absl::StrFormat("reprojection error %.4f px, %.4f px on left-out pictures", quality.rmse_px,
                         quality.heldout_rmse_px);
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
  WriteParameters(found.parameters, step);
  step->set_rmse_px(found.quality.rmse_px);
  step->set_heldout_rmse_px(found.quality.heldout_rmse_px);
  step->set_lack_of_fit_p(found.quality.lack_of_fit_p);
}

void WriteBoardQuality(const boards::BoardQuality& quality, v1::Quality* message) {
  message->set_rmse_px(quality.rmse_px);
  message->set_heldout_rmse_px(quality.heldout_rmse_px);
  message->set_lack_of_fit_p(quality.lack_of_fit_p);
}

}  // namespace

v1::Report WriteBoardReport(const boards::BoardSet& set, const boards::BoardDiagnosis& diagnosis) {
  v1::Report report;
  report.set_verdict(ToMessage(diagnosis.verdict));
  report.set_images(static_cast<uint32_t>(diagnosis.pictures));
  report.set_model_name(diagnosis.model_name);
  report.set_model_hash(diagnosis.model_hash);
  report.set_summary(diagnosis.summary);
  if (diagnosis.initial) WriteBoardQuality(*diagnosis.initial, report.mutable_initial());
  if (diagnosis.final) WriteBoardQuality(*diagnosis.final, report.mutable_final());
  if (diagnosis.noise.sigma_px > 0) {
    report.mutable_noise_floor()->set_sigma_px(diagnosis.noise.sigma_px);
    report.mutable_noise_floor()->set_degrees_of_freedom(
        static_cast<uint32_t>(diagnosis.noise.degrees_of_freedom));
  }
  for (const std::string& warning : diagnosis.warnings) report.add_warnings(warning);
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
