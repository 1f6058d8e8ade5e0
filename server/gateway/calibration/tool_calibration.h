// Where the tip stands on the flange: the pivot method. The tip rests in one fixed point, a conical hole for
// instance, while the flange turns about it.
#pragma once

#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

namespace touchstone::gateway::calibration {

struct ToolCalibration {
  Eigen::Vector3d flange_from_tip_m;            // translation
  Eigen::Vector3d flange_from_tip_std_error_m;  // standard errors, x, y and z of the flange
  Eigen::Vector3d pivot_m;                      // the fixed point, base frame
  Eigen::Vector3d pivot_std_error_m;
  double rms_m = 0;    // of what the poses leave over, one coordinate
  size_t worst = 0;    // the pose that fits worst
  double worst_m = 0;  // how far its tip lies from the fixed point
};

inline constexpr size_t kMinToolPoses = 4;

// Least squares over flange poses (base_from_flange) whose tips all stand in one point. INVALID_ARGUMENT for
// fewer than four poses, or poses that turn too little to tell the tip; names the direction on the flange
// that stays unknown.
absl::StatusOr<ToolCalibration> CalibrateTool(const std::vector<Eigen::Isometry3d>& base_from_flange);

}  // namespace touchstone::gateway::calibration
