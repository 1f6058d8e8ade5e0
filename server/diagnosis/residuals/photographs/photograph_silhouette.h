// The outline of an object in a measured picture against the expected one.
#pragma once

#include <cstdint>
#include <vector>

namespace touchstone::diagnosis::residuals {

struct Silhouette {
  double iou = 0;                  // share of the object's pixels in both of those in either; NaN: unknown
  double contour_distance_px = 0;  // between the two outlines, root mean square; NaN: unknown
};

// `measured` and `expected` grey levels and the expected object (mask: not 0), width x height, rows from the top.
Silhouette CompareSilhouettes(const std::vector<float>& measured, const std::vector<float>& expected,
                              const std::vector<uint8_t>& mask, int width, int height);

// Squared distance of each pixel to the nearest one that is set (Felzenszwalb and Huttenlocher 2012); very large where
// none is.
std::vector<float> SquaredDistances(const std::vector<char>& set, int width, int height);

// Pixels of `object` beside one that is not.
std::vector<char> OutlineOf(const std::vector<char>& object, int width, int height);

}  // namespace touchstone::diagnosis::residuals
