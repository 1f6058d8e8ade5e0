// How far, how fast and where the arm may move.
#pragma once

#include <array>
#include <optional>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "server/base/touch_limits.h"
#include "server/gateway/arm/kinematics/arm_model.h"

namespace touchstone::gateway::arm {

// What a rig permits; each is a key of the gateway's configuration.
struct MotionLimits {
  double max_speed_m_s = 0.1;  // of an approach
  // Slower, an approach of 60 mm takes longer than ten minutes, and the arm's own noise is most of its speed.
  double min_speed_m_s = 1e-4;
  double transit_speed_m_s = 0.15;
  double acceleration_m_s2 = 1.2;  // of approaches and transits
  double max_standoff_m = 0.15;
  double stroke_beyond_target_m =
      kDefaultStrokeBeyondTargetM;  // an approach without a stroke of its own ends so far behind its target
  double max_tilt_rad = 1.0472;     // of an approach from straight down, base frame
  double clearance_m = 0.05;        // transits cross so far above the object's box and every start
  // The box, base frame, that every fingertip must stay in.
  Eigen::Vector3d box_min_m{-0.5, -0.5, 0.0}, box_max_m{0.5, 0.5, 0.7};
  // The one that elbow, wrist, flange and camera must stay in, farther from its sides than the margin: about the radius
  // of the links. Not given, it has no walls, and its floor is that of the tips.
  Eigen::Vector3d arm_box_min_m = Eigen::Vector3d::Constant(-kUnlimitedM);
  Eigen::Vector3d arm_box_max_m = Eigen::Vector3d::Constant(kUnlimitedM);
  double arm_margin_m = 0.045;
  double max_arm_speed_m_s = 0.25;  // of elbow, wrist, flange and camera, in any motion
  // Force on the tip beyond what was felt at rest before the motion, at which it is stopped. The default lies below
  // what a UR3e measures (30 N) and well above the error of a CB3's estimate (10 N); UR's own limits begin at 100 N.
  double max_force_n = 25;
  // The joints that the arm must stay between.
  std::array<double, 6> joint_min_rad{{-6.2832, -6.2832, -6.2832, -6.2832, -6.2832, -6.2832}};
  std::array<double, 6> joint_max_rad{{6.2832, 6.2832, 6.2832, 6.2832, 6.2832, 6.2832}};
  double payload_kg = 0.5;
  // Centre of gravity of the payload, flange frame; none: the controller keeps that of its installation.
  std::optional<Eigen::Vector3d> payload_cog_m;
  double outermost_finger_m =
      0.03;  // tip of the outermost finger from the middle one's, along x of the tip frame
  // The tool looks down, high above what lies on the fixture: the arm crosses to it at its tip's height.
  std::array<double, 6> home_rad{{0, -1.5708, -0.9599, -2.1817, 1.5708, 0}};

  static constexpr double kUnlimitedM = 1e3;
  // arm_box_min_m, with the tips' floor where it has none.
  Eigen::Vector3d ArmBoxMin() const {
    Eigen::Vector3d lower = arm_box_min_m;
    if (lower.z() <= -kUnlimitedM) lower.z() = box_min_m.z();
    return lower;
  }
};

// INVALID_ARGUMENT names a limit that makes no sense for this arm, its value and what would be right.
absl::Status CheckMotionLimits(const MotionLimits& limits, const ArmModel& model);

}  // namespace touchstone::gateway::arm
