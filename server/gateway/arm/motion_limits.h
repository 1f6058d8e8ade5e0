// How far, how fast and where the arm may move.
#pragma once

#include <array>
#include <optional>

#include <absl/status/status.h>
#include <Eigen/Core>

namespace touchstone::gateway::arm {

// What a rig permits; each is a key of the gateway's configuration.
struct MotionLimits {
  double max_speed_m_s = 0.1;  // of an approach
  double transit_speed_m_s = 0.15;
  double acceleration_m_s2 = 1.2;  // of approaches and transits
  double max_standoff_m = 0.15;
  double stroke_beyond_target_m =
      0.03;                      // an approach without a stroke of its own ends so far behind its target
  double max_tilt_rad = 1.0472;  // of an approach from straight down, base frame
  double clearance_m = 0.05;     // transits cross so far above the object's box and every start
  // The box, base frame, that the tip must stay in, and the joints that the arm must stay between.
  Eigen::Vector3d box_min_m{-0.5, -0.5, 0.0}, box_max_m{0.5, 0.5, 0.7};
  std::array<double, 6> joint_min_rad{{-6.2832, -6.2832, -6.2832, -6.2832, -6.2832, -6.2832}};
  std::array<double, 6> joint_max_rad{{6.2832, 6.2832, 6.2832, 6.2832, 6.2832, 6.2832}};
  double payload_kg = 0.5, max_payload_kg = 3.0;
  // Centre of gravity of the payload, flange frame; none: the controller keeps that of its installation.
  std::optional<Eigen::Vector3d> payload_cog_m;
  double outermost_finger_m =
      0.03;  // tip of the outermost finger from the middle one's, along x of the tip frame
  // The tool looks down, high above what lies on the fixture: the arm crosses to it at its tip's height.
  std::array<double, 6> home_rad{{0, -1.5708, -0.9599, -2.1817, 1.5708, 0}};
};

// INVALID_ARGUMENT names a limit that makes no sense, its value and what would be right.
absl::Status CheckMotionLimits(const MotionLimits& limits);

}  // namespace touchstone::gateway::arm
