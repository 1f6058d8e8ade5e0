// From linear light to grey levels: vignetting, defocus, motion, exposure, response, added terms, noise, rounding.
// Part of the simulation of photographs only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/effects/photo_settings.h"
#include "server/image/photograph/photo_lens.h"
#include "server/image/scene/view.h"

namespace touchstone::image {

// What formulas read of the surface, per pixel of the whole picture; only filled where there are formulas.
struct PixelSurface {
  std::vector<float> incidence_rad, depth_m;
};

// `light`, height x width, becomes expected grey levels from 0 to 255. Outside `object` it is the ground's. What lies beyond
// the picture's border is taken to be as bright as the border. Returns the pixels outside which all grey levels are the
// same. Error: an added term that is not finite.
absl::StatusOr<PixelBox> RecordLight(const effects::PhotoSettings& settings, const PhotoLens& lens,
                                     const PixelSurface& surface, double session_time_s,
                                     const PixelBox& object, std::vector<float>* light);

// Noise by (seed, index, pixel), rounded to 8 bits.
void DrawPixels(const effects::PhotoSettings& settings, const std::vector<float>& grey, uint64_t seed,
                uint64_t index, std::vector<uint8_t>* pixels);

// Weights of a box of this length along a direction (0: right, pi / 2: up) over neighbouring pixels; they sum to 1.
struct MotionTap {
  int right, down;
  float weight;
};
std::vector<MotionTap> MotionKernel(double length_px, double angle_rad);

}  // namespace touchstone::image
