#include "server/diagnosis/boards/board_diagnosis.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numeric>

#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/distributions.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/diagnosis/boards/board_search.h"
#include "server/diagnosis/engine/ladder.h"
#include "server/diagnosis/engine/resampled_covariance.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::boards {
namespace {

// `fullest`: the lens with all effects.
engine::Quality QualityOf(const BoardSet& set, const LensFit& lens, const LensFit& fullest) {
  const double corners = static_cast<double>(set.pictures.size()) * set.board.corners();
  const double unseen_px2 = std::accumulate(lens.unseen_px2.begin(), lens.unseen_px2.end(), 0.0);
  return {std::sqrt(lens.fit.columns.values.col(0).squaredNorm() / corners), std::sqrt(unseen_px2 / corners),
          LackOfFitP(lens, fullest)};
}

std::string Summary(const BoardSet& set, const BoardDiagnosis& diagnosis) {
  const auto error = [](const engine::Quality& quality) {
    return absl::StrFormat("%.3f px (%.3f px on left-out pictures)", quality.rmse, quality.heldout_rmse);
  };
  if (diagnosis.verdict == engine::Verdict::kTooLittleData)
    return absl::StrFormat(
        "The board was found in %d pictures; %d are needed, from different sides.%s", diagnosis.pictures,
        diagnosis.pictures_needed,
        diagnosis.pictures > 0
            ? ""
            : absl::StrFormat(" Is %dx%d the number of its inner corners, where four squares "
                              "meet, and is the whole board in the pictures?",
                              set.board.columns, set.board.rows));
  std::string words =
      absl::StrFormat("Reprojection error of %d corners in %d pictures: %s with the nominal lens%s.",
                      diagnosis.corners, diagnosis.pictures, error(*diagnosis.initial),
                      set.camera_is_guess ? ", which is a guess (no camera.yaml)" : "");
  for (const engine::LadderStep& step : diagnosis.steps) {
    const auto value = [](const engine::ParameterEstimate& p) {
      return absl::StrFormat("%s%s%s %.5g +- %.2g", p.name, p.entry.empty() ? "" : " ", p.entry, p.value,
                             p.std_error);
    };
    absl::StrAppend(&words, " With ", step.effect, " (",
                    absl::StrJoin(step.parameters, ", ",
                                  [&](std::string* out, const auto& p) { absl::StrAppend(out, value(p)); }),
                    "): ", error(step.quality), ".");
  }
  if (diagnosis.steps.empty()) words += " No effect of the projection is missing.";
  for (const BoardRest& rest : diagnosis.rest) {
    const auto value = [](std::string* out, const std::pair<std::string, double>& v) {
      absl::StrAppendFormat(out, "%s %.4g", v.first, v.second);
    };
    absl::StrAppend(&words, " The catalogue has no effect for what is left: ", rest.name, " (",
                    absl::StrJoin(rest.values, ", ", value), ") would leave ", error(rest.quality), ".");
  }
  return words;
}

absl::Status AddSteps(const BoardSet& set, const BoardSearch& search, const std::vector<LensFit>& ladder,
                      const LensFit& fullest, uint64_t seed, BoardDiagnosis* diagnosis) {
  const LensFit& last = ladder.back();
  const Eigen::MatrixXd covariance = engine::ResampledCovariance(search.experiment(), last.fit, seed);
  // Few pictures know little of their own scatter.
  const double t = StudentQuantile(0.975, static_cast<double>(set.pictures.size()) - 1);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<engine::SelectedStep> selected, search.Compete(last));
  for (const engine::SelectedStep& from : selected) {
    const int k = from.effect;
    engine::LadderStep step = engine::DescribeStep(last.fit, covariance, from);
    step.gain_nats = ladder[k + 1].fit.log_evidence - ladder[k].fit.log_evidence;
    for (engine::ParameterEstimate& estimate : step.parameters) {
      estimate.lower = estimate.value - t * estimate.std_error;
      estimate.upper = estimate.value + t * estimate.std_error;
    }
    step.quality = QualityOf(set, ladder[k + 1], fullest);
    engine::AddConfounded(step, &diagnosis->confounded);
    diagnosis->steps.push_back(std::move(step));
  }
  return absl::OkStatus();
}

// What no effect of the catalogue has and left-out pictures are predicted better with, one after the other.
absl::Status AddRest(const BoardSet& set, const BoardSearch& search, const LensFit& named,
                     const LensFit& fullest, BoardDiagnosis* diagnosis) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<LensFit> ladder, search.FindNameless(named));
  const int first = static_cast<int>(named.fit.model.base().effects.size());
  for (int k = 1; k < static_cast<int>(ladder.size()); ++k) {
    const engine::Fit& fit = ladder[k].fit;
    BoardRest found;
    found.name = fit.model.base().effects[first + k - 1].effect->name;
    found.gain_nats = fit.log_evidence - ladder[k - 1].fit.log_evidence;
    found.quality = QualityOf(set, ladder[k], fullest);
    for (const engine::ParameterEstimate& value :
         fit.model.Describe(first + k - 1, fit.point, fit.covariance))
      found.values.emplace_back(value.name, value.value);
    diagnosis->rest.push_back(std::move(found));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<BoardDiagnosis> DiagnoseBoards(const BoardSet& set, const model::Model& model, uint64_t seed) {
  const auto began = std::chrono::steady_clock::now();
  BoardDiagnosis diagnosis;
  diagnosis.model_name = model.name;
  diagnosis.model_hash = model.Hash();
  diagnosis.pictures = static_cast<int>(set.pictures.size());
  diagnosis.corners = diagnosis.pictures * set.board.corners();
  if (!set.without_board.empty())
    diagnosis.warnings.push_back(absl::StrCat("no whole board of ", set.board.columns, "x", set.board.rows,
                                              " inner corners was found in ",
                                              absl::StrJoin(set.without_board, ", ")));
  if (diagnosis.pictures < kMinBoardPictures) {
    diagnosis.verdict = engine::Verdict::kTooLittleData;
    diagnosis.pictures_needed = kMinBoardPictures;
    diagnosis.summary = Summary(set, diagnosis);
    return diagnosis;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<BoardSearch> search, BoardSearch::Make(set, model));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<LensFit> ladder, search->FindNamed());
  TOUCHSTONE_ASSIGN_OR_RETURN(const LensFit fullest, search->FitAll(ladder.back()));
  diagnosis.initial = QualityOf(set, ladder.front(), fullest);
  diagnosis.final = QualityOf(set, ladder.back(), fullest);
  diagnosis.noise.degrees_of_freedom = search->DegreesOfFreedom(fullest);
  if (diagnosis.noise.degrees_of_freedom > 0) diagnosis.noise.sigma = fullest.fit.sigma;
  TOUCHSTONE_RETURN_IF_ERROR(AddSteps(set, *search, ladder, fullest, seed, &diagnosis));
  TOUCHSTONE_RETURN_IF_ERROR(AddRest(set, *search, ladder.back(), fullest, &diagnosis));
  diagnosis.verdict = !diagnosis.rest.empty()    ? engine::Verdict::kUnexplained
                      : !diagnosis.steps.empty() ? engine::Verdict::kMissingEffects
                                                 : engine::Verdict::kAdequate;
  if (!diagnosis.steps.empty()) {
    diagnosis.improved_model = WithEffectsOf(model, ladder.back().fit.model.base());
  }
  diagnosis.summary = Summary(set, diagnosis);
  diagnosis.duration_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return diagnosis;
}

}  // namespace touchstone::diagnosis::boards
