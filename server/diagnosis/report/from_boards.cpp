#include "server/diagnosis/report/from_boards.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <cmath>

namespace touchstone::diagnosis::report {
namespace {

Quality QualityOf(const boards::BoardQuality& quality) {
  return {quality.rmse_px, quality.heldout_rmse_px, quality.lack_of_fit_p};
}

std::string ErrorWords(const boards::BoardQuality& quality) {
  return absl::StrFormat("reprojection error %.4f px, %.4f px on left-out pictures", quality.rmse_px,
                         quality.heldout_rmse_px);
}

Step BoardStepOf(const boards::BoardStep& from) {
  Step step;
  step.effect = from.effect;
  step.equivalent = from.equivalent;
  step.probability = from.probability;
  step.gain_nats = from.gain_nats;
  step.parameters = from.parameters;
  step.meaning = from.meaning;
  step.check_on_rig = from.check_on_rig;
  step.remedy = from.remedy;
  step.words = ErrorWords(from.quality);
  return step;
}

Unexplained RestOf(const std::vector<boards::BoardRest>& rests) {
  Unexplained unexplained;
  std::vector<std::string> words;
  for (const boards::BoardRest& rest : rests)
    words.push_back(absl::StrCat(rest.name, ": ", ErrorWords(rest.quality)));
  unexplained.words = absl::StrJoin(words, "; ");
  unexplained.rmse = rests.back().quality.rmse_px;
  unexplained.heldout_rmse = rests.back().quality.heldout_rmse_px;
  return unexplained;
}

DataReport DataOf(const boards::BoardDiagnosis& found, const boards::BoardSet& set) {
  DataReport data;
  data.kind = DataKind::kBoards;
  data.session = set.origin;
  data.count = found.pictures;
  data.needed = found.pictures_needed;
  data.rows = static_cast<int>(set.pictures.size() + set.without_board.size());
  data.poses = static_cast<int>(set.pictures.size());
  if (!set.without_board.empty())
    data.set_aside.rows.push_back(
        {"the whole board is not in the picture", static_cast<int>(set.without_board.size()), {}});
  if (found.initial) data.initial = QualityOf(*found.initial);
  if (found.final) data.final = QualityOf(*found.final);
  if (found.noise.sigma_px > 0) {
    data.noise_floor.emplace();
    // Of a corner, as the errors are: two coordinates.
    data.noise_floor->sigma = std::sqrt(2.0) * found.noise.sigma_px;
    data.noise_floor->degrees_of_freedom = found.noise.degrees_of_freedom;
  }
  if (data.noise_floor && data.initial)
    data.reducible_share = ReducibleShare(*data.noise_floor, data.initial->rmse);
  if (!found.rest.empty()) data.unexplained = RestOf(found.rest);
  return data;
}

}  // namespace

Diagnosis FromBoards(const boards::BoardDiagnosis& found, const boards::BoardSet& set) {
  Diagnosis diagnosis;
  diagnosis.verdict = found.verdict;
  diagnosis.model_name = found.model_name;
  diagnosis.model_hash = found.model_hash;
  diagnosis.data = {DataOf(found, set)};
  for (const boards::BoardStep& step : found.steps) {
    diagnosis.steps.push_back(BoardStepOf(step));
    diagnosis.data[0].after_step.push_back(QualityOf(step.quality));
  }
  diagnosis.improved_model = found.improved_model;
  diagnosis.summary = found.summary;
  diagnosis.warnings = found.warnings;
  diagnosis.duration_s = found.duration_s;
  return diagnosis;
}

}  // namespace touchstone::diagnosis::report
