#include "server/image/photograph.h"

#include <cmath>

namespace touchstone::image {

Intrinsics PinholeIntrinsics(int width, int height, double vertical_fov_rad) {
  Intrinsics intrinsics;
  intrinsics.width = width, intrinsics.height = height;
  intrinsics.fx_px = intrinsics.fy_px = 0.5 * height / std::tan(0.5 * vertical_fov_rad);
  intrinsics.cx_px = 0.5 * (width - 1), intrinsics.cy_px = 0.5 * (height - 1);
  return intrinsics;
}

}  // namespace touchstone::image
