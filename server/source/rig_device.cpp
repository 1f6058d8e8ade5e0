#include "server/source/rig_device.h"

#include <absl/strings/str_format.h>

#include <cmath>

namespace touchstone::source {

std::string ViewId(const ViewCommand& command) {
  std::string id = "view " + command.object;
  const Eigen::Matrix<double, 3, 4> pose = command.object_from_camera.matrix().topRows<3>();
  // Adding 0 makes one zero of the two.
  for (int i = 0; i < pose.size(); ++i)
    absl::StrAppendFormat(&id, " %.6f", std::round(pose(i) * 1e6) / 1e6 + 0.0);
  return id;
}

}  // namespace touchstone::source
