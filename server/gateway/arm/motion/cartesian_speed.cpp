#include "server/gateway/arm/motion/cartesian_speed.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "server/gateway/arm/motion/line_turn.h"
#include "server/gateway/arm/motion/ur_script.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kStepM = 0.01, kStepRad = 0.07;
constexpr double kShare = 0.8;  // of a joint's speed

// By what factor the arm must slow down for a step that would take so long.
double SlowingFor(const UrKinematics& kinematics, const Joints& from, const Joints& to, double step_s) {
  const std::array<double, 6>& max_rad_s = kinematics.model().max_joint_speed_rad_s;
  double slower = 0;
  for (size_t i = 0; i < 6 && step_s > 0; ++i)
    slower = std::max(slower, std::abs(to[i] - from[i]) / (kShare * max_rad_s[i] * step_s));
  return slower;
}

}  // namespace

Eigen::Isometry3d PoseBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double part) {
  const Eigen::AngleAxisd turn(from.linear().transpose() * to.linear());
  Eigen::Isometry3d pose = from;
  pose.translation() += part * (to.translation() - from.translation());
  pose.linear() = from.linear() * Eigen::AngleAxisd(part * turn.angle(), turn.axis()).toRotationMatrix();
  return pose;
}

double LimitedCartesianSpeed(const UrKinematics& kinematics, const ArmBody& body,
                             const Eigen::Isometry3d& tip_from_flange, const Eigen::Isometry3d& from,
                             const Eigen::Isometry3d& to, double speed_m_s, Joints* joints) {
  const double line_speed_m_s = LineSpeed(from, to, speed_m_s);
  const Eigen::Vector3d line_m = to.translation() - from.translation();
  const double turn_rad = TurnRad(from, to);
  const int steps =
      std::max(1, static_cast<int>(std::ceil(std::max(line_m.norm() / kStepM, turn_rad / kStepRad))));
  const double step_s = std::max(line_m.norm() / line_speed_m_s, turn_rad / kMaxTurnRadS) / steps;
  double slower = 1;
  BodyPoints points = body.At(kinematics, *joints);
  for (int step = 1; step <= steps; ++step) {
    const std::optional<Joints> found = kinematics.Nearest(
        PoseBetween(from, to, static_cast<double>(step) / steps) * tip_from_flange, *joints);
    if (!found.has_value()) break;
    const double slowing = SlowingFor(kinematics, *joints, *found, step_s);
    slower = std::max(slower, slowing);
    Joints before = *joints;
    for (int k = 1; k <= kFinerSteps && slowing > kFinerFromShare; ++k) {
      const double part = (step - 1 + static_cast<double>(k) / kFinerSteps) / steps;
      const std::optional<Joints> fine =
          kinematics.Nearest(PoseBetween(from, to, part) * tip_from_flange, before);
      if (!fine.has_value()) break;
      slower = std::max(slower, SlowingFor(kinematics, before, *fine, step_s / kFinerSteps));
      before = *fine;
    }
    const BodyPoints next = body.At(kinematics, *found);
    if (step_s > 0)
      slower = std::max(slower, ArmBody::Farthest(points, next, nullptr) / (body.max_speed_m_s() * step_s));
    points = next;
    *joints = *found;
  }
  return line_speed_m_s / slower;
}

double LimitedJointSpeed(const UrKinematics& kinematics, const ArmBody& body, const Joints& from,
                         const Joints& to, double speed_rad_s) {
  const double way_rad = Farthest(from, to);
  if (way_rad <= 0) return speed_rad_s;
  const int steps = std::max(1, static_cast<int>(std::ceil(way_rad / kStepRad)));
  const double step_s = way_rad / speed_rad_s / steps;
  double slower = 1;
  for (size_t i = 0; i < 6; ++i)
    slower = std::max(slower, std::abs(to[i] - from[i]) /
                                  (kShare * kinematics.model().max_joint_speed_rad_s[i] * step_s * steps));
  BodyPoints points = body.At(kinematics, from);
  for (int step = 1; step <= steps; ++step) {
    const BodyPoints next = body.At(kinematics, JointsBetween(from, to, static_cast<double>(step) / steps));
    slower = std::max(slower, ArmBody::Farthest(points, next, nullptr) / (body.max_speed_m_s() * step_s));
    points = next;
  }
  return speed_rad_s / slower;
}

Joints JointsBetween(const Joints& from, const Joints& to, double part) {
  Joints joints = from;
  for (size_t i = 0; i < 6; ++i) joints[i] += part * (to[i] - from[i]);
  return joints;
}

}  // namespace touchstone::gateway::arm
