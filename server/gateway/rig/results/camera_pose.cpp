#include "server/gateway/rig/results/camera_pose.h"

#include <absl/strings/str_format.h>

#include <algorithm>

#include "server/base/units.h"
#include "server/geometry/pose.h"

namespace touchstone::gateway {

absl::StatusOr<MeasuredCameraPose> MeasureCameraPose(const std::vector<arm::ArmState>& states,
                                                     const Eigen::Isometry3d& tip_from_camera,
                                                     const Eigen::Isometry3d& base_from_camera,
                                                     const CameraPoseTolerance& tolerance) {
  if (states.empty())
    return absl::UnavailableError(
        "the controller told no pose while the picture was taken, so where it was taken from is unknown: "
        "take it again");
  // The departures are small, so that they can be averaged as vectors.
  Eigen::Vector3d shift = Eigen::Vector3d::Zero(), turn = Eigen::Vector3d::Zero();
  MeasuredCameraPose measured;
  for (const arm::ArmState& state : states) {
    const Eigen::Isometry3d departure = base_from_camera.inverse() * state.base_from_tip * tip_from_camera;
    const Eigen::AngleAxisd rotation(departure.rotation());
    shift += departure.translation() / static_cast<double>(states.size());
    turn += rotation.angle() * rotation.axis() / static_cast<double>(states.size());
    measured.deviation_m = std::max(measured.deviation_m, departure.translation().norm());
    measured.deviation_rad = std::max(measured.deviation_rad, std::abs(rotation.angle()));
  }
  measured.base_from_camera = base_from_camera * Eigen::Translation3d(shift);
  if (turn.norm() > 0) measured.base_from_camera.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  if (measured.deviation_m <= tolerance.position_m && measured.deviation_rad <= tolerance.angle_rad)
    return measured;
  return absl::FailedPreconditionError(
      absl::StrFormat("the camera was %.3g mm and %.3g deg from the commanded pose while the picture was "
                      "taken, and %.3g mm and %.3g deg "
                      "are allowed (camera.pose_tolerance_mm, camera.pose_tolerance_deg): the picture is not "
                      "kept; see what moves or "
                      "holds the arm, and take it again",
                      measured.deviation_m / kMetresPerMillimetre, measured.deviation_rad / kRadiansPerDegree,
                      tolerance.position_m / kMetresPerMillimetre, tolerance.angle_rad / kRadiansPerDegree));
}

}  // namespace touchstone::gateway
