// A photograph as a camera gives it, and the lens that it was taken through.
#pragma once

#include <cstdint>
#include <vector>

namespace touchstone::image {

struct Frame {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;  // height x width x 3
  double host_time_s = 0;    // when it was taken, as well as is known
  uint64_t number = 0;
};

// Pinhole with radial and tangential distortion, as OpenCV writes it (camera_matrix,
// distortion_coefficients).
struct Intrinsics {
  int width = 0, height = 0;
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  std::vector<double> distortion;  // k1 k2 p1 p2 k3; empty: none
};

// The lens for pictures of another size of the same sensor; one that says no size of its own is left as it is.
Intrinsics ScaledTo(const Intrinsics& lens, int width, int height);

// An ideal pinhole of this vertical field of view (radians), its axis through the middle of the picture.
Intrinsics PinholeIntrinsics(int width, int height, double vertical_fov_rad);

}  // namespace touchstone::image
