#include "server/gateway/arm/motion/line_check.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/gateway/arm/motion/cartesian_speed.h"
#include "server/gateway/arm/motion/line_turn.h"
#include "server/gateway/arm/motion/ur_script.h"

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
  const std::optional<Joints> found = kinematics_.Nearest(base_from_tip * tip_from_flange_, near);
  if (!found.has_value()) return false;
  *joints = *found;
  return true;
}

Eigen::Isometry3d LineCheck::TipAt(const Joints& joints) const {
  return kinematics_.Forward(joints) * tip_from_flange_.inverse();
}

std::array<Eigen::Vector3d, 3> LineCheck::Tips(const Eigen::Isometry3d& base_from_tip) const {
  const Eigen::Vector3d side = limits_.outermost_finger_m * base_from_tip.linear().col(0);
  const Eigen::Vector3d& middle = base_from_tip.translation();
  return {middle, middle - side, middle + side};
}

absl::Status LineCheck::CheckTips(const Eigen::Isometry3d& base_from_tip, const std::string& what) const {
  const std::array<Eigen::Vector3d, 3> tips = Tips(base_from_tip);
  for (size_t k = 0; k < tips.size(); ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      const double lower = limits_.box_min_m[axis], upper = limits_.box_max_m[axis];
      if (tips[k][axis] >= lower - kBoxToleranceM && tips[k][axis] <= upper + kBoxToleranceM) continue;
      return absl::OutOfRangeError(absl::StrFormat(
          "%s leads %s to %c = %.1f mm in the base frame; the box goes from %.1f to %.1f mm", what,
          k == 0 ? "the tip" : "an outer finger's tip", "xyz"[axis], tips[k][axis] / kMetresPerMillimetre,
          lower / kMetresPerMillimetre, upper / kMetresPerMillimetre));
    }
  }
  return absl::OkStatus();
}

absl::Status LineCheck::OutOfReach(const Eigen::Isometry3d& base_from_tip, const std::string& what) const {
  return absl::OutOfRangeError(
      absl::StrFormat("%s is out of reach of the %s at %s m in the base frame: its flange would be %.0f mm "
                      "from the base; the arm reaches %.0f mm from its shoulder",
                      what, kinematics_.model().name, PointText(base_from_tip.translation()),
                      (base_from_tip * tip_from_flange_).translation().norm() / kMetresPerMillimetre,
                      kinematics_.model().reach_m / kMetresPerMillimetre));
}

absl::Status LineCheck::CheckJointLimits(const Joints& joints, const std::string& what,
                                         int* wrist_3_beyond) const {
  for (size_t i = 0; i < 6; ++i) {
    const bool above = joints[i] > limits_.joint_max_rad[i] + kJointToleranceRad;
    if (!above && joints[i] >= limits_.joint_min_rad[i] - kJointToleranceRad) continue;
    if (i == 5) *wrist_3_beyond = above ? 1 : -1;
    return absl::OutOfRangeError(absl::StrFormat(
        "%s would turn %s to %.1f deg; its limits are %.1f and %.1f deg", what, kJointNames[i],
        Degrees(joints[i]), Degrees(limits_.joint_min_rad[i]), Degrees(limits_.joint_max_rad[i])));
  }
  return absl::OkStatus();
}

absl::Status LineCheck::CheckStep(const Joints& from, const Joints& to, double step_s, double max_slowing,
                                  double speed_m_s, const Eigen::Vector3d& tip_m,
                                  const std::string& what) const {
  const std::array<double, 6>& max_rad_s = kinematics_.model().max_joint_speed_rad_s;
  for (size_t i = 0; i < 6; ++i) {
    const double change_rad = std::abs(to[i] - from[i]);
    if (change_rad > kJumpRad)
      return absl::OutOfRangeError(absl::StrFormat(
          "%s passes a singularity at %s m in the base frame: %s would jump by %.0f deg, at most %.0f", what,
          PointText(tip_m), kJointNames[i], Degrees(change_rad), Degrees(kJumpRad)));
    if (step_s > 0 && change_rad > max_rad_s[i] * step_s * max_slowing)
      return absl::OutOfRangeError(absl::StrFormat(
          "%s at %.1f mm/s would turn %s at %.0f deg/s near %s m in the base frame; %.0f deg/s is its limit",
          what, speed_m_s / kMetresPerMillimetre, kJointNames[i], Degrees(change_rad / step_s),
          PointText(tip_m), Degrees(max_rad_s[i])));
  }
  return absl::OkStatus();
}

double LineCheck::FastShare(const Joints& from, const Joints& to, double step_s) const {
  double share = 0;
  for (size_t i = 0; i < 6 && step_s > 0; ++i)
    share =
        std::max(share, std::abs(to[i] - from[i]) / (kinematics_.model().max_joint_speed_rad_s[i] * step_s));
  return share;
}

absl::Status LineCheck::CheckBodyStep(const BodyPoints& from, const BodyPoints& to, double step_s,
                                      double max_slowing, double speed_m_s, const std::string& what) const {
  const char* which = "";
  const double way_m = ArmBody::Farthest(from, to, &which);
  if (way_m <= body_.max_speed_m_s() * step_s * max_slowing) return absl::OkStatus();
  return absl::OutOfRangeError(absl::StrFormat(
      "%s at %.1f mm/s would move the arm's %s at %.0f mm/s; at most %.0f mm/s (max_arm_speed_mm_s)", what,
      speed_m_s / kMetresPerMillimetre, which, way_m / step_s / kMetresPerMillimetre,
      body_.max_speed_m_s() / kMetresPerMillimetre));
}

absl::Status LineCheck::Follow(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                               bool may_slow, const std::string& what, Joints* joints, int* wrist_3_beyond,
                               SingularityWatch* watch) const {
  *wrist_3_beyond = 0;
  // An end that cannot be reached is reported as such, not as the stretched elbow on the path to it.
  TOUCHSTONE_RETURN_IF_ERROR(CheckTips(to, what));
  if (Joints unused; !JointsAt(to, *joints, &unused)) return OutOfReach(to, what);
  TOUCHSTONE_RETURN_IF_ERROR(CheckLineTurn(from, to, what));
  const Eigen::Vector3d line_m = to.translation() - from.translation();
  const double turn_rad = TurnRad(from, to);
  const int steps = std::max(
      1, static_cast<int>(std::ceil(std::max(line_m.norm() / kCheckStepM, turn_rad / kCheckStepRad))));
  const double step_s =
      std::max(line_m.norm() / LineSpeed(from, to, speed_m_s), turn_rad / kMaxTurnRadS) / steps;
  const double max_slowing = may_slow ? kMaxSlowing : 1;
  BodyPoints points = body_.At(kinematics_, *joints);
  for (int step = 0; step <= steps; ++step) {
    const Eigen::Isometry3d pose = PoseBetween(from, to, static_cast<double>(step) / steps);
    TOUCHSTONE_RETURN_IF_ERROR(CheckTips(pose, what));

    Joints next;
    if (!JointsAt(pose, *joints, &next)) return OutOfReach(pose, what);
    // Only in another posture, to which no straight line leads.
    if (Farthest(next, *joints) > kPostureRad) return OutOfReach(pose, what);
    TOUCHSTONE_RETURN_IF_ERROR(
        CheckStep(*joints, next, step > 0 ? step_s : 0, max_slowing, speed_m_s, pose.translation(), what));
    if (step > 0 && FastShare(*joints, next, step_s) > kFinerFromShare) {
      Joints before = *joints, fine = next;
      for (int k = 1; k <= kFinerSteps; ++k) {
        const Eigen::Isometry3d at =
            PoseBetween(from, to, (step - 1 + static_cast<double>(k) / kFinerSteps) / steps);
        if (!JointsAt(at, before, &fine)) return OutOfReach(at, what);
        TOUCHSTONE_RETURN_IF_ERROR(
            CheckStep(before, fine, step_s / kFinerSteps, max_slowing, speed_m_s, at.translation(), what));
        before = fine;
      }
    }
    TOUCHSTONE_RETURN_IF_ERROR(CheckJointLimits(next, what, wrist_3_beyond));
    const BodyPoints next_points = body_.At(kinematics_, next);
    TOUCHSTONE_RETURN_IF_ERROR(body_.CheckInside(next_points, what));
    if (step > 0)
      TOUCHSTONE_RETURN_IF_ERROR(CheckBodyStep(points, next_points, step_s, max_slowing, speed_m_s, what));
    if (watch != nullptr) watch->Look(kinematics_, next_points, next, pose.translation(), what);
    *joints = next;
    points = next_points;
  }
  return absl::OkStatus();
}

absl::Status LineCheck::FollowJoints(const Joints& from, const Joints& to, double floor_m,
                                     const std::string& what) const {
  int unused = 0;
  const int steps = std::max(1, static_cast<int>(std::ceil(Farthest(from, to) / kCheckStepRad)));
  for (int step = 0; step <= steps; ++step) {
    const Joints joints = JointsBetween(from, to, static_cast<double>(step) / steps);
    TOUCHSTONE_RETURN_IF_ERROR(CheckJointLimits(joints, what, &unused));
    const Eigen::Isometry3d pose = TipAt(joints);
    TOUCHSTONE_RETURN_IF_ERROR(CheckTips(pose, what));
    for (const Eigen::Vector3d& tip : Tips(pose))
      if (tip.z() < floor_m - kBoxToleranceM)
        return absl::OutOfRangeError(
            absl::StrFormat("%s leads a fingertip down to z = %.1f mm in the base frame, below %.1f mm", what,
                            tip.z() / kMetresPerMillimetre, floor_m / kMetresPerMillimetre));
    TOUCHSTONE_RETURN_IF_ERROR(body_.CheckInside(body_.At(kinematics_, joints), what));
  }
  return absl::OkStatus();
}

}  // namespace touchstone::gateway::arm
