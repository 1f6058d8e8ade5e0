#include "server/diagnosis/boards/board_diagnosis.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numeric>

#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/text/value_text.h"
#include "server/diagnosis/boards/board_search.h"
#include "server/diagnosis/boards/rules.h"
#include "server/diagnosis/engine/fit/fitted_values.h"
#include "server/diagnosis/engine/fit/resampled_covariance.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::boards {
namespace {

// What corners may show beside effects of the catalogue.
struct BoardHypothesis {
  enum { kBeyondCatalogue };
};
const std::vector<engine::HypothesisRule>& BoardHypothesisRules() {
  static const auto& rules = *new std::vector<engine::HypothesisRule>{
      // Every lens effect without a name has competed with each step (BoardSearch::Compete).
      {BoardHypothesis::kBeyondCatalogue, "lens beyond the catalogue", engine::Leaves::kBeside, {}},
  };
  return rules;
}

// `fullest`: the lens with all effects.
engine::Quality QualityOf(const BoardSet& set, const LensFit& lens, const LensFit& fullest) {
  const double corners = static_cast<double>(set.pictures.size()) * set.board.corners();
  const double unseen_px2 = std::accumulate(lens.unseen_px2.begin(), lens.unseen_px2.end(), 0.0);
  return {std::sqrt(lens.fit.columns.values.col(0).squaredNorm() / corners), std::sqrt(unseen_px2 / corners),
          LackOfFitP(lens, fullest)};
}

std::string InWords(const BoardLens& lens) {
  const auto value = [](const char* name, double value_px, double error_px) {
    return absl::StrCat(name, " ", ValueWithError(value_px, error_px));
  };
  const session::CameraIntrinsics& c = lens.camera;
  std::string words = absl::StrCat(
      "The lens: ", value("fx", c.fx_px, lens.fx_error_px), ", ", value("fy", c.fy_px, lens.fy_error_px),
      ", ", value("cx", c.cx_px, lens.cx_error_px), ", ", value("cy", c.cy_px, lens.cy_error_px), " px");
  if (c.k1 != 0 || c.k2 != 0) absl::StrAppendFormat(&words, ", k1 %.4f, k2 %.4f", c.k1, c.k2);
  return words + ".";
}

// Without pictures whose corners are another's to the last digits: a copy says nothing new.
BoardSet WithoutCopies(const BoardSet& set, std::vector<std::string>* copies) {
  BoardSet distinct = set;
  distinct.pictures.clear();
  for (const BoardPicture& picture : set.pictures) {
    const bool copied =
        std::any_of(distinct.pictures.begin(), distinct.pictures.end(), [&](const BoardPicture& other) {
          double farthest_px = 0;
          for (size_t corner = 0; corner < picture.corners_px.size(); ++corner)
            farthest_px =
                std::max(farthest_px, (picture.corners_px[corner] - other.corners_px[corner]).norm());
          return farthest_px < kBoardRules.copy_px;
        });
    if (copied)
      copies->push_back(picture.file);
    else
      distinct.pictures.push_back(picture);
  }
  return distinct;
}

// How many orientations of the board lie BoardRules::min_tilt_apart_deg apart, each picture's against all that count so far.
absl::StatusOr<int> OrientationsOf(const BoardSet& set, const image::PhotoLens& lens) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<BoardPose> poses, StartPoses(set, lens));
  std::vector<Eigen::Vector3d> normals;
  for (const BoardPose& pose : poses) {
    const Eigen::Vector3d normal = pose.rotation.col(2);
    if (std::all_of(normals.begin(), normals.end(), [&](const Eigen::Vector3d& other) {
          return normal.dot(other) < std::cos(kBoardRules.min_tilt_apart_deg * M_PI / 180);
        }))
      normals.push_back(normal);
  }
  return static_cast<int>(normals.size());
}

BoardLens LensOf(const BoardSet& set, const model::Model& model, const BoardDiagnosis& diagnosis) {
  const image::PhotoLens found = LensOfModel(set.camera, model);
  BoardLens lens;
  lens.camera = set.camera;
  lens.camera.fx_px = found.fx, lens.camera.fy_px = found.fy;
  lens.camera.cx_px = found.cx, lens.camera.cy_px = found.cy;
  lens.camera.k1 = found.k1, lens.camera.k2 = found.k2, lens.camera.k3 = found.k3;
  lens.camera.p1 = found.p1, lens.camera.p2 = found.p2;
  for (const engine::LadderStep& step : diagnosis.steps)
    for (const engine::ParameterEstimate& p : step.parameters) {
      if (step.effect == "focal_error") {
        lens.fx_error_px = set.camera.fx_px * p.std_error;
        lens.fy_error_px = set.camera.fy_px * p.std_error;
      }
      if (step.effect == "principal_point")
        (p.entry == "x" ? lens.cx_error_px : lens.cy_error_px) = p.std_error;
    }
  return lens;
}

std::string Summary(const BoardSet& set, const BoardDiagnosis& diagnosis) {
  const auto error = [](const engine::Quality& quality) {
    return absl::StrFormat("%.3f px (%.3f px on left-out pictures)", quality.rmse, quality.heldout_rmse);
  };
  if (diagnosis.verdict == engine::Verdict::kTooLittleData && diagnosis.orientations > 0)
    return absl::StrFormat(
        "The board was found in %d pictures, but stands in %d %s of %d that a lens takes, %g deg apart: "
        "nothing "
        "tells its focal length from the board's distance. Take pictures with the board tilted by 10 to 40 "
        "deg, to "
        "the left and right and up and down.",
        diagnosis.pictures, diagnosis.orientations,
        diagnosis.orientations == 1 ? "orientation" : "orientations", kBoardRules.min_orientations.value(),
        kBoardRules.min_tilt_apart_deg.value());
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
      return absl::StrCat(p.name, p.entry.empty() ? "" : " ", p.entry, " ",
                          ValueWithError(p.value, p.std_error));
    };
    absl::StrAppend(&words, " With ", step.effect, " (",
                    absl::StrJoin(step.parameters, ", ",
                                  [&](std::string* out, const auto& p) { absl::StrAppend(out, value(p)); }),
                    "): ", error(step.quality), ".");
  }
  if (diagnosis.steps.empty()) words += " No effect of the projection is missing.";
  if (diagnosis.lens) absl::StrAppend(&words, " ", InWords(*diagnosis.lens));
  for (const BoardRest& rest : diagnosis.rest) {
    const auto value = [](std::string* out, const std::pair<std::string, double>& v) {
      absl::StrAppendFormat(out, "%s %.4g", v.first, v.second);
    };
    absl::StrAppend(&words, " The catalogue has no effect for what is left: ", rest.name, " (",
                    absl::StrJoin(rest.values, ", ", value), ") would leave ", error(rest.quality), ".");
  }
  return words;
}

// Two readings a corner, as errors are counted.
void AddBudget(const BoardSet& set, const LensFit& lens, const Eigen::MatrixXd& covariance,
               BoardDiagnosis* diagnosis) {
  const int values = lens.fit.model.size(), corners = set.board.corners();
  std::vector<int> all(values);
  std::iota(all.begin(), all.end(), 0);
  const double noise = std::sqrt(2.0) * diagnosis->noise.sigma;
  uncertainty::PictureBudgetSum sum(engine::FittedValuesOf(lens.fit.model, all, covariance), noise);
  for (int picture = 0; picture < diagnosis->pictures; ++picture) {
    const auto derivatives = lens.fit.columns.values.block(static_cast<Eigen::Index>(picture) * 2 * corners,
                                                           1, 2 * corners, values);
    sum.Add("", derivatives.transpose() * derivatives / corners);
  }
  diagnosis->uncertainty = sum.Budgets();
  uncertainty::AddMisfit({diagnosis->final->rmse, noise, diagnosis->final->lack_of_fit_p}, 1,
                         &diagnosis->uncertainty);
}

absl::Status AddSteps(const BoardSet& set, const BoardSearch& search, const std::vector<LensFit>& ladder,
                      const LensFit& fullest, uint64_t seed, BoardDiagnosis* diagnosis) {
  const LensFit& last = ladder.back();
  const Eigen::MatrixXd covariance = engine::ResampledCovariance(search.experiment(), last.fit, seed);
  // Few pictures know little of their own scatter.
  AddBudget(set, last, covariance, diagnosis);
  const double t = StudentQuantile(0.975, static_cast<double>(set.pictures.size()) - 1);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<engine::SelectedStep> selected, search.Compete(last));
  for (const engine::SelectedStep& from : selected) {
    const int k = from.effect;
    const engine::Fit& with_it = ladder[k + 1].fit;
    engine::LadderStep& step =
        engine::AddStep(last.fit, covariance, from, {}, QualityOf(set, ladder[k + 1], fullest), diagnosis);
    step.gain_nats = with_it.log_evidence - ladder[k].fit.log_evidence;
    for (engine::ParameterEstimate& estimate : step.parameters) {
      estimate.lower = estimate.value - t * estimate.std_error;
      estimate.upper = estimate.value + t * estimate.std_error;
    }
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

absl::StatusOr<BoardDiagnosis> DiagnoseBoards(const BoardSet& all, const model::Model& model, uint64_t seed) {
  const auto began = std::chrono::steady_clock::now();
  BoardDiagnosis diagnosis;
  const BoardSet set = WithoutCopies(all, &diagnosis.copies);
  diagnosis.model_name = model.name;
  diagnosis.model_hash = model.Hash();
  diagnosis.pictures = static_cast<int>(set.pictures.size());
  diagnosis.corners = diagnosis.pictures * set.board.corners();
  if (!set.without_board.empty())
    diagnosis.warnings.push_back(absl::StrCat("no whole board of ", set.board.columns, "x", set.board.rows,
                                              " inner corners was found in ",
                                              absl::StrJoin(set.without_board, ", ")));
  if (diagnosis.pictures < kBoardRules.min_pictures) {
    diagnosis.verdict = engine::Verdict::kTooLittleData;
    diagnosis.pictures_needed = kBoardRules.min_pictures;
    diagnosis.summary = Summary(set, diagnosis);
    return diagnosis;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(diagnosis.orientations, OrientationsOf(set, LensOfModel(set.camera, model)));
  if (diagnosis.orientations < kBoardRules.min_orientations) {
    diagnosis.verdict = engine::Verdict::kTooLittleData;
    diagnosis.pictures_needed = diagnosis.pictures + kBoardRules.min_orientations - diagnosis.orientations;
    diagnosis.summary = Summary(set, diagnosis);
    return diagnosis;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<BoardSearch> search, BoardSearch::Make(set, model));
  TOUCHSTONE_ASSIGN_OR_RETURN(const engine::TriedPValues tried, search->TryAll(seed));
  diagnosis.nothing_missing = engine::WorstOfAll(tried);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<LensFit> ladder, search->FindNamed());
  TOUCHSTONE_ASSIGN_OR_RETURN(const LensFit fullest, search->FitAll(ladder.back()));
  diagnosis.initial = QualityOf(set, ladder.front(), fullest);
  diagnosis.final = QualityOf(set, ladder.back(), fullest);
  diagnosis.noise.degrees_of_freedom = search->DegreesOfFreedom(fullest);
  if (diagnosis.noise.degrees_of_freedom > 0) diagnosis.noise.sigma = fullest.fit.sigma;
  TOUCHSTONE_RETURN_IF_ERROR(AddSteps(set, *search, ladder, fullest, seed, &diagnosis));
  TOUCHSTONE_RETURN_IF_ERROR(AddRest(set, *search, ladder.back(), fullest, &diagnosis));
  engine::Hypotheses found(BoardHypothesisRules());
  if (!diagnosis.rest.empty()) found.Add(BoardHypothesis::kBeyondCatalogue);
  engine::Conclude(found, 1, &diagnosis);
  diagnosis.improved = diagnosis.changed ? WithEffectsOf(model, ladder.back().fit.model.base()) : model;
  diagnosis.lens = LensOf(set, diagnosis.improved, diagnosis);
  diagnosis.summary = Summary(set, diagnosis);
  diagnosis.duration_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return diagnosis;
}

}  // namespace touchstone::diagnosis::boards
