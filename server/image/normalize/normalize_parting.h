// What differs from the ground, without what may be its shadow: where the object lies, roughly.
#pragma once

#include <vector>

#include "server/image/normalize/normalize_ground.h"
#include "server/image/normalize/normalize_region.h"

namespace touchstone::image {

// A photograph and the light of the ground behind everything, channel by channel (one or three).
struct GroundedPicture {
  std::vector<Plane> grey;    // as recorded
  std::vector<Plane> calm;    // without its noise
  std::vector<Plane> ground;  // as it is lit where no shadow falls
  float noise = 0;            // standard deviation, grey levels

  int width() const { return grey[0].width; }
  int height() const { return grey[0].height; }
  size_t channels() const { return grey.size(); }
};

// What is left of white noise in `calm`, as a share of it.
inline constexpr float kCalmNoise = 0.2f;

// Relative grey (the logarithm of grey over ground) is cut at many levels; the region stays whose outline is the
// steepest and which holds most of what differs from the ground. What is brighter than the ground or of another colour
// is never its shadow. Empty: nothing parts from the ground.
Region PartFromGround(const GroundedPicture& picture);

}  // namespace touchstone::image
