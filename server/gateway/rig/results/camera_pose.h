// Where the camera was while a picture was taken, from the arm's states. Pure functions.
#pragma once

#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/arm.h"

namespace touchstone::gateway {

// How far the measured pose of a camera may be from the commanded one. The default is five times the pose repeatability
// that Universal Robots publish for the UR3 (+-0.1 mm; UR3e: +-0.03 mm), and the same at 0.3 m from the camera.
struct CameraPoseTolerance {
  double position_m = 0.0005;
  double angle_rad = 0.0017453292519943296;  // 0.1 deg
};

struct MeasuredCameraPose {
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();  // mean over the states
  double deviation_m = 0, deviation_rad = 0;  // of the state that is farthest from the commanded pose
};

// From every state of the time in which the picture was taken. FAILED_PRECONDITION with both numbers if a state is
// farther from the commanded pose than the tolerance, UNAVAILABLE if there is no state.
absl::StatusOr<MeasuredCameraPose> MeasureCameraPose(const std::vector<arm::ArmState>& states,
                                                     const Eigen::Isometry3d& tip_from_camera,
                                                     const Eigen::Isometry3d& base_from_camera,
                                                     const CameraPoseTolerance& tolerance);

}  // namespace touchstone::gateway
