#include "server/gateway/arm/cartesian_speed.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/gateway/arm/ur_script.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kStepM = 0.01, kStepRad = 0.07;
constexpr double kShare = 0.8;  // of a joint's speed

}  // namespace

const std::array<double, 6>& MaxJointSpeeds() {
  static constexpr std::array<double, 6> kSpeeds = {kPi, kPi, kPi, 2 * kPi, 2 * kPi, 2 * kPi};
  return kSpeeds;
}

double LimitedCartesianSpeed(const UrKinematics& kinematics, const Eigen::Isometry3d& tip_from_flange,
                             const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                             Joints* joints) {
  const double line_speed_m_s = LineSpeed(from, to, speed_m_s);
  const Eigen::Vector3d line_m = to.translation() - from.translation();
  const Eigen::AngleAxisd turn(from.linear().transpose() * to.linear());
  const int steps =
      std::max(1, static_cast<int>(std::ceil(std::max(line_m.norm() / kStepM, turn.angle() / kStepRad))));
  const double step_s = std::max(line_m.norm() / line_speed_m_s, turn.angle() / kMaxTurnRadS) / steps;
  double slower = 1;
  for (int step = 1; step <= steps; ++step) {
    const double part = static_cast<double>(step) / steps;
    Eigen::Isometry3d pose = from;
    pose.translation() += part * line_m;
    pose.linear() = from.linear() * Eigen::AngleAxisd(part * turn.angle(), turn.axis()).toRotationMatrix();
    const std::vector<Joints> found = kinematics.Inverse(pose * tip_from_flange, *joints);
    if (found.empty()) break;
    for (size_t i = 0; i < 6 && step_s > 0; ++i)
      slower = std::max(slower,
                        std::abs(found.front()[i] - (*joints)[i]) / (kShare * MaxJointSpeeds()[i] * step_s));
    *joints = found.front();
  }
  return line_speed_m_s / slower;
}

}  // namespace touchstone::gateway::arm
