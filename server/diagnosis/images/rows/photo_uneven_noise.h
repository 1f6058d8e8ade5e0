// Whether the noise of pixels differs between parts of a set by more than the model of the noise says: one object, one
// stretch of the session, one picture, a side of the picture, the ground, a range of grey levels. It is no noise of the
// catalogue, and where it is cut at black it looks like light of the ground.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

struct UnevenNoise {
  engine::CovariateTest test;  // corrected for all that was tried
  std::string words;           // sentences for people
};

// `expected`: by the best model. Contours take no part: their place is no noise. Nothing where one noise (sigma and gain)
// says the same, or the scales differ by less than a third.
std::optional<UnevenNoise> FindUnevenNoise(const Photographs& photographs,
                                           const std::vector<image::Photo>& expected, ThreadPool* pool);

}  // namespace touchstone::diagnosis::images
