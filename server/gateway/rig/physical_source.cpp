#include "server/gateway/rig/physical_source.h"

#include <absl/strings/str_format.h>

#include <cmath>

namespace touchstone {

std::string ViewId(const ViewOrder& order) {
  std::string id = "view " + order.object;
  const Eigen::Matrix<double, 3, 4> pose = order.object_from_camera.matrix().topRows<3>();
  // Adding 0 makes one zero of the two.
  for (int i = 0; i < pose.size(); ++i)
    absl::StrAppendFormat(&id, " %.6f", std::round(pose(i) * 1e6) / 1e6 + 0.0);
  return id;
}

Intrinsics PinholeIntrinsics(int width, int height, double vertical_fov_rad) {
  Intrinsics intrinsics;
  intrinsics.width = width, intrinsics.height = height;
  intrinsics.fx_px = intrinsics.fy_px = 0.5 * height / std::tan(0.5 * vertical_fov_rad);
  intrinsics.cx_px = 0.5 * (width - 1), intrinsics.cy_px = 0.5 * (height - 1);
  return intrinsics;
}

}  // namespace touchstone
