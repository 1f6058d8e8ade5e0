// The light of the ground behind an object, as Normalize sees it.
#pragma once

#include <cstddef>
#include <vector>

namespace touchstone::image {

// Values of one channel, height x width.
struct Plane {
  int width = 0, height = 0;
  std::vector<float> values;

  Plane() = default;
  Plane(int w, int h) : width(w), height(h), values(static_cast<size_t>(w) * h) {}
  float& at(int x, int y) { return values[static_cast<size_t>(y) * width + x]; }
  float at(int x, int y) const { return values[static_cast<size_t>(y) * width + x]; }
};

// Gaussian blur, edges repeated.
Plane Blurred(const Plane& plane, float sigma_px);

// Each pixel as the mean of those of the 49 around it that differ by no more than noise does: edges stay.
Plane WithoutNoise(const Plane& grey, float noise);

// Standard deviation of the noise: from second differences, so that light and shading do not count (median).
float NoiseOf(const Plane& grey);

// A polynomial of order three: through the rim, as most of it agrees, then through everything that agrees with that.
Plane FitGround(const Plane& grey, float noise);

// The empty place's picture, without its noise and with the exposure of the photograph (median ratio along the rim).
Plane GroundOf(const Plane& background, const Plane& grey);

}  // namespace touchstone::image
