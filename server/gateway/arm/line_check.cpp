#include "server/gateway/arm/line_check.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/gateway/arm/cartesian_speed.h"
#include "server/gateway/arm/ur_script.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kCheckStepM = 0.005, kCheckStepRad = 0.035;
constexpr double kJumpRad = 0.35;  // of a joint from sample to sample: another branch, or a wrist that flips
constexpr double kPostureRad = 1;
constexpr double kBoxToleranceM = 1e-6, kJointToleranceRad = 1e-4;
constexpr const char* kJointNames[] = {"base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3"};
constexpr double kMaxSlowing = 10;

double Degrees(double angle_rad) {
  return angle_rad / kRadiansPerDegree;
}

}  // namespace

std::string PointText(const Eigen::Vector3d& point_m) {
  return absl::StrFormat("(%.3f, %.3f, %.3f)", point_m.x(), point_m.y(), point_m.z());
}

bool LineCheck::JointsAt(const Eigen::Isometry3d& base_from_tip, const Joints& near, Joints* joints) const {
  const std::vector<Joints> found = kinematics_.Inverse(base_from_tip * tip_from_flange_, near);
  if (found.empty()) return false;
  *joints = found.front();
  return true;
}

Eigen::Isometry3d LineCheck::TipAt(const Joints& joints) const {
  return kinematics_.Forward(joints) * tip_from_flange_.inverse();
}

absl::Status LineCheck::CheckTips(const Eigen::Isometry3d& base_from_tip, const std::string& what) const {
  for (const double side : {0.0, -1.0, 1.0}) {
    const Eigen::Vector3d tip = base_from_tip * Eigen::Vector3d(side * limits_.outermost_finger_m, 0, 0);
    for (int axis = 0; axis < 3; ++axis) {
      const double lower = limits_.box_min_m[axis], upper = limits_.box_max_m[axis];
      if (tip[axis] >= lower - kBoxToleranceM && tip[axis] <= upper + kBoxToleranceM) continue;
      return absl::OutOfRangeError(absl::StrFormat(
          "%s leads %s to %c = %.1f mm in the base frame; the box goes from %.1f to %.1f mm", what,
          side == 0 ? "the tip" : "an outer finger's tip", "xyz"[axis], tip[axis] / kMetresPerMillimetre,
          lower / kMetresPerMillimetre, upper / kMetresPerMillimetre));
    }
  }
  return absl::OkStatus();
}

absl::Status LineCheck::OutOfReach(const Eigen::Isometry3d& base_from_tip, const std::string& what) const {
  return absl::OutOfRangeError(
      absl::StrFormat("%s is out of reach of the %s at %s m in the base frame: its flange would be %.0f mm "
                      "from the base; the arm "
                      "reaches 500 mm from its shoulder",
                      what, arm_model_, PointText(base_from_tip.translation()),
                      (base_from_tip * tip_from_flange_).translation().norm() / kMetresPerMillimetre));
}

absl::Status LineCheck::Follow(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                               bool may_slow, const std::string& what, Joints* joints,
                               int* wrist_3_beyond) const {
  *wrist_3_beyond = 0;
  // An end that cannot be reached is reported as such, not as the stretched elbow on the path to it.
  TOUCHSTONE_RETURN_IF_ERROR(CheckTips(to, what));
  if (Joints unused; !JointsAt(to, *joints, &unused)) return OutOfReach(to, what);
  const Eigen::Vector3d line_m = to.translation() - from.translation();
  const Eigen::AngleAxisd turn(from.linear().transpose() * to.linear());
  const int steps = std::max(
      1, static_cast<int>(std::ceil(std::max(line_m.norm() / kCheckStepM, turn.angle() / kCheckStepRad))));
  const double step_s =
      std::max(line_m.norm() / LineSpeed(from, to, speed_m_s), turn.angle() / kMaxTurnRadS) / steps;
  for (int step = 0; step <= steps; ++step) {
    const double fraction = static_cast<double>(step) / steps;
    Eigen::Isometry3d pose = from;
    pose.translation() += fraction * line_m;
    pose.linear() =
        from.linear() * Eigen::AngleAxisd(fraction * turn.angle(), turn.axis()).toRotationMatrix();
    TOUCHSTONE_RETURN_IF_ERROR(CheckTips(pose, what));

    Joints next;
    if (!JointsAt(pose, *joints, &next)) return OutOfReach(pose, what);
    for (size_t i = 0; i < 6; ++i) {
      const double change_rad = std::abs(next[i] - (*joints)[i]);
      // Only in another posture, to which no straight line leads.
      if (change_rad > kPostureRad) return OutOfReach(pose, what);
      if (change_rad > kJumpRad)
        return absl::OutOfRangeError(absl::StrFormat(
            "%s passes a singularity at %s m in the base frame: %s would jump by %.0f deg, at most %.0f",
            what, PointText(pose.translation()), kJointNames[i], Degrees(change_rad), Degrees(kJumpRad)));
      if (step > 0 && change_rad > MaxJointSpeeds()[i] * step_s * (may_slow ? kMaxSlowing : 1))
        return absl::OutOfRangeError(absl::StrFormat(
            "%s at %.1f mm/s would turn %s at %.0f deg/s near %s m in the base frame; %.0f deg/s is its "
            "limit",
            what, speed_m_s / kMetresPerMillimetre, kJointNames[i], Degrees(change_rad / step_s),
            PointText(pose.translation()), Degrees(MaxJointSpeeds()[i])));
      const bool above = next[i] > limits_.joint_max_rad[i] + kJointToleranceRad;
      if (!above && next[i] >= limits_.joint_min_rad[i] - kJointToleranceRad) continue;
      if (i == 5) *wrist_3_beyond = above ? 1 : -1;
      return absl::OutOfRangeError(absl::StrFormat(
          "%s would turn %s to %.1f deg; its limits are %.1f and %.1f deg", what, kJointNames[i],
          Degrees(next[i]), Degrees(limits_.joint_min_rad[i]), Degrees(limits_.joint_max_rad[i])));
    }
    *joints = next;
  }
  return absl::OkStatus();
}

}  // namespace touchstone::gateway::arm
