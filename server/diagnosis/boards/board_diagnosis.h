// What a lens differs from its model by, told by pictures of a flat board: the diagnosis of a nominal pinhole.
//
// Observations are the corners, px; every picture's pose of the board is a nuisance that is always fitted. Explanations are
// the catalogue's effects of the projection (focal_error, principal_point, radial_distortion) and, to keep those honest, what
// a lens may do besides, which has no effect: it can only be named as a rest. An effect is claimed where the corners are
// BoardRules::min_gain_nats more probable with it (the engine's evidence, sigma unknown) and pictures that the fit did not see are predicted
// better: the lens is fitted without the picture, its pose to one half of its corners (like the colours of a chessboard), the
// error is that of the other half, and the other way round.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/boards/board_set.h"
#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/engine/nothing_missing.h"
#include "server/model/model.h"
#include "server/uncertainty/budget.h"

namespace touchstone::diagnosis::boards {

// Errors (engine::Quality) are reprojection errors: sqrt(sum ||measured - predicted||^2 / corners), px, as
// cv::calibrateCamera gives it; lens and poses fitted to all corners, or, held out, of left-out pictures. The lack of fit is
// LackOfFitP against the lens with all terms, named or not. The noise (engine::NoiseFloor) is that of one coordinate of a
// corner, px: no two readings of a corner are repeats, so this is what the lens with all terms leaves, and an upper bound;
// 0: fewer readings than values that were fitted. Steps have standard errors from resampled pictures.

// What is left and has no effect of the catalogue.
struct BoardRest {
  std::string name;  // "tangential distortion"
  double gain_nats = 0;
  engine::Quality quality;                             // with it beside all steps
  std::vector<std::pair<std::string, double>> values;  // "p1", ...
};

// The lens with all steps, px; standard errors of what they change, else 0.
struct BoardLens {
  session::CameraIntrinsics camera;
  double fx_error_px = 0, fy_error_px = 0, cx_error_px = 0, cy_error_px = 0;
};

struct BoardDiagnosis : engine::Improvement {
  std::string model_name, model_hash;
  int pictures = 0, corners = 0;                          // that took part; corners of all pictures
  std::optional<engine::Quality> initial, final;          // none with kTooLittleData
  std::optional<engine::NothingMissing> nothing_missing;  // of the given model; none with kTooLittleData
  engine::NoiseFloor noise;
  std::vector<BoardRest> rest;
  int pictures_needed = 0;          // with kTooLittleData
  int orientations = 0;             // of the board, BoardRules::min_tilt_apart_deg apart; 0: not looked at
  std::vector<std::string> copies;  // files whose corners are another's to the last digits: counted once
  std::optional<BoardLens> lens;    // none with kTooLittleData
  // Of a corner that the lens predicts, the picture's pose fitted to its corners; of all pictures, px. None with kTooLittleData.
  std::vector<uncertainty::Budget> uncertainty;
  std::string summary;
  std::vector<std::string> warnings;
  double duration_s = 0;
};

// `model`: its effects of the projection are part of the nominal lens. The seed draws the resampled pictures.
absl::StatusOr<BoardDiagnosis> DiagnoseBoards(const BoardSet& set, const model::Model& model, uint64_t seed);

}  // namespace touchstone::diagnosis::boards
