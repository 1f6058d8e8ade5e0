// Points that stand for the arm's body in checks: where they may be and how fast they may go.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/kinematics/kinematics.h"
#include "server/gateway/arm/kinematics/motion_limits.h"
#include "server/gateway/calibration/calibration.h"

namespace touchstone::gateway::arm {

// Base frame, m.
struct BodyPoints {
  std::array<Eigen::Vector3d, 7> links;   // UrKinematics::LinkPoints
  std::optional<Eigen::Vector3d> camera;  // its centre of projection; none: the calibration has none
};

class ArmBody {
 public:
  ArmBody(const MotionLimits& limits, const calibration::Calibration& calibration);

  BodyPoints At(const UrKinematics& kinematics, const Joints& joints) const;
  // OUT_OF_RANGE if elbow, wrist, flange or camera leave their box, less the margin. What stays where it is - base and
  // shoulder - is not looked at. Box and margins are convex, so that the links between the points are inside with them.
  absl::Status CheckInside(const BodyPoints& points, const std::string& what) const;
  // How far the one of them that moves farthest does, m. *which names it, unless null.
  static double Farthest(const BodyPoints& from, const BodyPoints& to, const char** which);
  double max_speed_m_s() const { return limits_.max_arm_speed_m_s; }

 private:
  MotionLimits limits_;
  std::optional<Eigen::Vector3d> camera_in_flange_m_;
};

}  // namespace touchstone::gateway::arm
