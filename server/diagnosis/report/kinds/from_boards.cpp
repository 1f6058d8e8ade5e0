#include "server/diagnosis/report/kinds/from_boards.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <cmath>

namespace touchstone::diagnosis::report {
namespace {

std::string ErrorWords(const Quality& quality) {
  return absl::StrFormat("reprojection error %.4f px, %.4f px on left-out pictures", quality.rmse,
                         quality.heldout_rmse);
}

Unexplained RestOf(const std::vector<boards::BoardRest>& rests) {
  Unexplained unexplained;
  std::vector<std::string> words;
  for (const boards::BoardRest& rest : rests)
    words.push_back(absl::StrCat(rest.name, ": ", ErrorWords(rest.quality)));
  unexplained.words = absl::StrJoin(words, "; ");
  unexplained.rmse = rests.back().quality.rmse;
  unexplained.heldout_rmse = rests.back().quality.heldout_rmse;
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
  data.lens = found.lens;
  if (found.initial) data.initial = *found.initial;
  if (found.final) data.final = *found.final;
  if (found.noise.sigma > 0) {
    data.noise_floor.emplace();
    // Of a corner, as the errors are: two coordinates.
    data.noise_floor->sigma = std::sqrt(2.0) * found.noise.sigma;
    data.noise_floor->degrees_of_freedom = found.noise.degrees_of_freedom;
  }
  if (data.noise_floor && data.initial)
    data.reducible_share = ReducibleShare(*data.noise_floor, data.initial->rmse);
  return data;
}

}  // namespace

Diagnosis FromBoards(const boards::BoardDiagnosis& found, const boards::BoardSet& set) {
  Diagnosis diagnosis;
  diagnosis.model_name = found.model_name;
  diagnosis.model_hash = found.model_hash;
  diagnosis.data = {DataOf(found, set)};
  AddImprovement(found, &diagnosis);
  for (Step& step : diagnosis.steps)
    step.words = absl::StrCat(ErrorWords(step.quality), step.words.empty() ? "." : "; ", step.words);
  if (!found.rest.empty()) diagnosis.data[0].unexplained = RestOf(found.rest);
  SetNothingMissing(found.nothing_missing, &diagnosis);
  diagnosis.uncertainty = found.uncertainty;
  diagnosis.summary = found.summary;
  diagnosis.warnings = found.warnings;
  SetCopiesAside(found.copies, &diagnosis);
  diagnosis.duration_s = found.duration_s;
  return diagnosis;
}

}  // namespace touchstone::diagnosis::report
