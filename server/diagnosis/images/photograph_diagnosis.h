// What a diagnosis of photographs finds, as plain values: grey levels (0 to 255), pixels; parameters in the units of
// files. report/ turns them into messages.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/engine/nothing_missing.h"
#include "server/model/model.h"
#include "server/session/images/image_set.h"
#include "server/uncertainty/budget.h"

namespace touchstone::diagnosis::images {

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

struct PhotographDiagnosis : engine::Improvement {
  std::string model_name, model_hash;
  int images = 0;  // that took part
  std::vector<std::string> objects;
  engine::NoiseFloor noise_floor;
  std::optional<engine::Quality> initial, final;
  std::optional<engine::NothingMissing> nothing_missing;  // none: too few pictures
  std::vector<engine::DataProblem> data_problems;
  int images_needed = 0;  // with kTooLittleData
  std::vector<uncertainty::Budget>
      uncertainty;  // of its predictions, by object and of all; grey levels of one pixel
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
