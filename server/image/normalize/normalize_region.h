// Regions of a picture: which one is the object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/image/normalize/normalize_ground.h"

namespace touchstone::image {

// height x width, 1 inside.
struct Region {
  int width = 0, height = 0;
  std::vector<uint8_t> inside;

  Region() = default;
  Region(int w, int h) : width(w), height(h), inside(static_cast<size_t>(w) * h) {}
  uint8_t& at(int x, int y) { return inside[static_cast<size_t>(y) * width + x]; }
  uint8_t at(int x, int y) const { return inside[static_cast<size_t>(y) * width + x]; }
  // Outside the picture there is nothing.
  bool Has(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height && at(x, y) != 0; }
  size_t Count() const;
};

// Specks go, small gaps close; what remains are components of at least a twelfth of the largest. Holes are filled, but
// for those through which the ground is seen: most of whose pixels `is_ground` has.
Region Cleaned(const Region& raw, const Region& is_ground);

// Which share of the picture's outermost pixels the region has.
double RimShare(const Region& region);

// `region`, and those holes of `taken` (a region around it) that touch it and have at most this share of its pixels.
Region WithSmallHoles(const Region& region, const Region& taken, double max_share);

// How steep `slope` (size of the gradient) is along the region's outline, on average; what leaves the picture counts 0.
float OutlineSteepness(const Region& region, const Plane& slope);

// Moves the outline by a pixel or two to where the picture (`channels`) is halfway between the means of both sides nearby.
Region Refined(const Region& region, const std::vector<Plane>& channels);

}  // namespace touchstone::image
