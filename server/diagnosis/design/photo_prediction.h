// What fitted models predict for photographs that were not taken yet, and how these predictions move when the models
// are fitted again to them: linearised_prediction.h for pictures.
#pragma once

#include <memory>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/design/linearised_prediction.h"
#include "server/diagnosis/design/view_candidates.h"
#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::design {

// A picture's cells (images/pixels/photo_cells.h), in standard deviations of their noise, along the directions in which any value
// of any model moves it: nothing else of a picture can tell the models apart to first order. One entry per model; the same
// directions for all. NaN where a model cannot be photographed, or where the object leaves the picture or is hardly in it.
// Pictures of more than DesignRules::max_side_px along a side are predicted in smaller ones of as much noise per angle.
// `noise`: of one pixel. Deterministic, whatever the pool.
absl::StatusOr<std::vector<LinearisedPrediction>> LinearisePhotographs(
    const std::vector<std::shared_ptr<const model::Model>>& models, const images::Photographs& present,
    const images::PixelNoise& noise, const std::vector<ViewCandidate>& candidates, ThreadPool* pool);

}  // namespace touchstone::diagnosis::design
