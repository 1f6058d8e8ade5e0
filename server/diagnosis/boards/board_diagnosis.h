// What a lens differs from its model by, told by pictures of a flat board: the diagnosis of a nominal pinhole.
//
// Observations are the corners, px; every picture's pose of the board is a nuisance that is always fitted. Explanations are
// the catalogue's effects of the projection (focal_error, principal_point, radial_distortion) and, to keep those honest, what
// a lens may do besides, which has no effect: it can only be named as a rest. An effect is claimed where the corners are
// kMinGainNats more probable with it (the engine's evidence, sigma unknown) and pictures that the fit did not see are predicted
// better: the lens is fitted without the picture, its pose to one half of its corners (like the colours of a chessboard), the
// error is that of the other half, and the other way round.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/boards/board_set.h"
#include "server/diagnosis/inference/parameter_estimate.h"
#include "server/diagnosis/selection/result.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::boards {

inline constexpr int kMinBoardPictures = 5;
inline constexpr double kMinGainNats = 3;

// Reprojection error: sqrt(sum ||measured - predicted||^2 / corners), px, as cv::calibrateCamera gives it.
struct BoardQuality {
  double rmse_px = 0;          // lens and poses fitted to all corners
  double heldout_rmse_px = 0;  // of left-out pictures, as above
  double lack_of_fit_p = 0;    // LackOfFitP against the lens with all terms, named or not
};

// Of one coordinate of a corner, px: no two readings of a corner are repeats, so this is what the lens with all terms leaves,
// and an upper bound.
struct BoardNoise {
  double sigma_px = 0;  // 0: fewer readings than values that were fitted
  int degrees_of_freedom = 0;
};

struct BoardStep {
  std::string effect;
  std::vector<std::string> equivalent;  // that these pictures cannot tell from it
  double probability = 0, gain_nats = 0;
  std::vector<inference::ParameterEstimate> parameters;  // standard errors from resampled pictures
  BoardQuality quality;                                  // with this step and all earlier ones, fitted anew
  std::string meaning, check_on_rig, remedy;
};

// What is left and has no effect of the catalogue.
struct BoardRest {
  std::string name;  // "tangential distortion"
  double gain_nats = 0;
  BoardQuality quality;                                // with it beside all steps
  std::vector<std::pair<std::string, double>> values;  // "p1", ...
};

struct BoardDiagnosis {
  selection::Verdict verdict = selection::Verdict::kNone;
  std::string model_name, model_hash;
  int pictures = 0, corners = 0;               // that took part; corners of all pictures
  std::optional<BoardQuality> initial, final;  // none with kTooLittleData
  BoardNoise noise;
  std::vector<BoardStep> steps;
  std::vector<BoardRest> rest;
  int pictures_needed = 0;  // with kTooLittleData
  std::string improved_model_yaml, improved_model_hash;
  std::string summary;
  std::vector<std::string> warnings;
  double duration_s = 0;
};

// `model`: its effects of the projection are part of the nominal lens. The seed draws the resampled pictures.
absl::StatusOr<BoardDiagnosis> DiagnoseBoards(const BoardSet& set, const model::Model& model, uint64_t seed);

}  // namespace touchstone::diagnosis::boards
