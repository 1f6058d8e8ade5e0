#include "server/image/photograph/photograph.h"

#include <cmath>

namespace touchstone::image {

Intrinsics PinholeIntrinsics(int width, int height, double vertical_fov_rad) {
  Intrinsics intrinsics;
  intrinsics.width = width, intrinsics.height = height;
  intrinsics.fx_px = intrinsics.fy_px = 0.5 * height / std::tan(0.5 * vertical_fov_rad);
  intrinsics.cx_px = 0.5 * (width - 1), intrinsics.cy_px = 0.5 * (height - 1);
  return intrinsics;
}

Intrinsics ScaledTo(const Intrinsics& lens, int width, int height) {
  if (lens.width <= 0 || lens.height <= 0) return lens;
  Intrinsics scaled = lens;
  const double x_scale = static_cast<double>(width) / lens.width,
               y_scale = static_cast<double>(height) / lens.height;
  scaled.width = width, scaled.height = height;
  scaled.fx_px *= x_scale, scaled.fy_px *= y_scale;
  // Pixel centres lie at integers, the picture's edges half a pixel before and behind.
  scaled.cx_px = (lens.cx_px + 0.5) * x_scale - 0.5;
  scaled.cy_px = (lens.cy_px + 0.5) * y_scale - 0.5;
  return scaled;
}

}  // namespace touchstone::image
