// What a diagnosis of photographs finds, as plain values: grey levels (0 to 255), pixels; parameters in the units of
// files. report/ turns them into messages.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/inference/parameter_estimate.h"
#include "server/diagnosis/selection/result.h"
#include "server/model/model.h"
#include "server/session/image_set.h"

namespace touchstone::diagnosis::images {

struct GreyQuality {
  double rmse_grey = 0;  // over all pixels that take part, as a comparison finds it
  double heldout_rmse_grey =
      0;  // the same on pictures that the fit did not see: the largest over left-out groups
  double lack_of_fit_p = 0;  // 0 to 1; of at least this misfit beyond the noise if nothing were missing
};

// The standard deviation of one pixel among repeats of one picture.
struct GreyNoiseFloor {
  double sigma_grey = 0;
  double lower_grey = 0, upper_grey = 0;  // 95 % interval; 0 if unknown
  double degrees_of_freedom = 0;
  bool from_repeats =
      false;  // false: an upper bound, from what neighbouring pixels of the best model's residuals differ by
};

// An effect to add, after all earlier ones; fields as in selection::LadderStep.
struct PhotographStep {
  std::string effect;
  selection::EffectScope scope = selection::EffectScope::kRig;
  std::vector<std::string> equivalent;
  std::string discriminating_measurement;
  double probability = 0;
  double gain_nats = 0;
  std::vector<inference::ParameterEstimate> parameters;
  GreyQuality quality;
  model::Model model;
  std::string meaning, check_on_rig, remedy, words;
};

struct RankedPhotographCandidate {
  std::string effect;
  selection::EffectScope scope = selection::EffectScope::kRig;
  selection::CandidateNote note = selection::CandidateNote::kNone;
  double probability = 0, gain_nats = 0;
  std::vector<inference::ParameterEstimate> parameters;
  double rmse_grey = 0, heldout_rmse_grey = 0;
};

// A part of the pictures that holds excess error.
struct PhotographSlice {
  std::string slice;  // "radius > 0.7 and object = lat10"
  int images = 0;     // with such pixels
  double mean_residual_grey = 0, rmse_grey = 0, share_of_excess_error = 0;
  std::string words;  // "brighter than expected by 12 grey levels"
};

struct PhotographError {
  uint64_t image = 0;
  std::string object;
  double rmse_grey = 0, rmse_after_grey = 0, mean_residual_grey = 0;
  double silhouette_iou = 1, contour_distance_px = 0;
};

// The residual against one covariate.
struct PhotographCurve {
  std::string covariate, unit;
  struct Bin {
    double centre = 0, mean_residual_grey = 0, std_error_grey = 0, after_grey = 0;
    int64_t count = 0;  // pixels
  };
  std::vector<Bin> bins;
  double p = 1, p_after = 1;
};

// One photograph side by side; images of the set's size, 8 bits, one channel, but the residuals, which are signed.
struct PhotographMap {
  uint64_t image = 0;
  std::string object;
  int width = 0, height = 0;
  std::vector<uint8_t> measured, before, after;
  std::vector<float> residual_before_grey, residual_after_grey;
};

struct ProposedPhotograph {
  std::string object;
  session::CameraPlacement camera;
  std::string purpose;
  double separation = 0;
  int photographs_to_verdict = 0;  // as design::ProposedTouch::touches_to_verdict
};

struct UnexplainedPhotographs {
  std::vector<selection::CovariateTest> covariates;
  std::string formula, formula_yaml, lookup_yaml, words;
  double rmse_grey = 0, heldout_rmse_grey = 0, heldout_gain = 0;
};

struct PhotographDataProblem {
  selection::ProblemKind kind = selection::ProblemKind::kChannelOrder;
  std::string detail, words, fix;
  double rmse_before_grey = 0, rmse_after_grey = 0;
};

struct PhotographDiagnosis {
  selection::Verdict verdict = selection::Verdict::kNone;
  std::string model_name, model_hash;
  int images = 0;  // that took part
  std::vector<std::string> objects;
  GreyNoiseFloor noise_floor;
  std::optional<GreyQuality> initial, final;
  double reducible_share = 0;  // of the mean square error that is not noise, 0 to 1

  std::vector<selection::RefittedEffect> refitted;
  std::vector<PhotographStep> steps;
  std::vector<RankedPhotographCandidate> candidates;
  std::vector<selection::ConfoundedEffects> confounded;
  std::vector<std::string> superfluous;
  std::vector<PhotographDataProblem> data_problems;
  std::optional<UnexplainedPhotographs> unexplained;
  int images_needed = 0;                       // with kTooLittleData
  std::optional<model::Model> improved_model;  // none: nothing changed
  std::vector<ProposedPhotograph> next_photographs;

  // Where.
  double silhouette_iou = 1, silhouette_iou_after = 1;            // measured against expected
  double contour_distance_px = 0, contour_distance_after_px = 0;  // root mean square
  std::vector<PhotographSlice> where;
  std::vector<PhotographCurve> curves;
  std::vector<PhotographError> photographs;
  std::vector<PhotographMap> maps;

  std::string summary;
  std::vector<std::string> warnings;
  double duration_s = 0;
};

}  // namespace touchstone::diagnosis::images
