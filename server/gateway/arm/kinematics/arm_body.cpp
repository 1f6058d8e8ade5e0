#include "server/gateway/arm/kinematics/arm_body.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace touchstone::gateway::arm {
namespace {

constexpr size_t kFirstMoving = 2;  // the elbow
constexpr const char* kPointNames[] = {"base",    "shoulder", "elbow", "wrist 1",
                                       "wrist 2", "wrist 3",  "flange"};
constexpr double kArmBoxToleranceM = 1e-6;

}  // namespace

ArmBody::ArmBody(const MotionLimits& limits, const calibration::Calibration& calibration) : limits_(limits) {
  if (calibration.has_camera) camera_in_flange_m_ = calibration.flange_from_camera.translation();
}

BodyPoints ArmBody::At(const UrKinematics& kinematics, const Joints& joints) const {
  BodyPoints points;
  points.links = kinematics.LinkPoints(joints);
  if (camera_in_flange_m_.has_value()) points.camera = kinematics.Forward(joints) * *camera_in_flange_m_;
  return points;
}

absl::Status ArmBody::CheckInside(const BodyPoints& points, const std::string& what) const {
  const Eigen::Vector3d lower = limits_.ArmBoxMin(), upper = limits_.arm_box_max_m;
  const auto check = [&](const Eigen::Vector3d& point, const char* name) -> absl::Status {
    for (int axis = 0; axis < 3; ++axis) {
      const double beyond_m = std::max(lower[axis] + limits_.arm_margin_m - point[axis],
                                       point[axis] - (upper[axis] - limits_.arm_margin_m));
      if (beyond_m <= kArmBoxToleranceM) continue;
      const bool low = point[axis] < lower[axis] + limits_.arm_margin_m;
      return absl::OutOfRangeError(absl::StrFormat(
          "%s leads the arm's %s to %c = %.1f mm in the base frame; %s %.1f mm less arm_margin_mm = %.1f mm",
          what, name, "xyz"[axis], point[axis] / kMetresPerMillimetre,
          low ? "the arm's box begins at" : "the arm's box ends at",
          (low ? lower : upper)[axis] / kMetresPerMillimetre, limits_.arm_margin_m / kMetresPerMillimetre));
    }
    return absl::OkStatus();
  };
  for (size_t i = kFirstMoving; i < points.links.size(); ++i)
    if (absl::Status inside = check(points.links[i], kPointNames[i]); !inside.ok()) return inside;
  return points.camera.has_value() ? check(*points.camera, "camera") : absl::OkStatus();
}

double ArmBody::Farthest(const BodyPoints& from, const BodyPoints& to, const char** which) {
  double farthest_m = 0;
  const auto look = [&](double m, const char* name) {
    if (m <= farthest_m) return;
    farthest_m = m;
    if (which != nullptr) *which = name;
  };
  for (size_t i = kFirstMoving; i < from.links.size(); ++i)
    look((to.links[i] - from.links[i]).norm(), kPointNames[i]);
  if (from.camera.has_value() && to.camera.has_value()) look((*to.camera - *from.camera).norm(), "camera");
  return farthest_m;
}

}  // namespace touchstone::gateway::arm
