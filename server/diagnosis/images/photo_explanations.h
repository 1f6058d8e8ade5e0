// The explanations of photographs that are left after a diagnosis: what further pictures are to tell apart.
#pragma once

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/images/pixels/pixel_noise.h"

namespace touchstone::diagnosis::images {

struct ExplanationsLeft : engine::ExplanationsLeft {
  PixelNoise noise;  // of what the best leaves
};

struct PhotoSelection;

// Without the nameless image field, which is no effect of a model file: both sides have it, and it tells nothing apart.
ExplanationsLeft FindExplanationsLeft(const PhotoSelection& selection);

}  // namespace touchstone::diagnosis::images
