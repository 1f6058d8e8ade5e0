// Whether the tip can follow a straight line: inside the box, reachable without a jump of the joints, within
// the joints' limits and speeds. Samples every 5 mm and 2 degrees.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/kinematics.h"
#include "server/gateway/arm/motion_limits.h"

namespace touchstone::gateway::arm {

class LineCheck {
 public:
  LineCheck(std::string arm_model, UrKinematics kinematics, const MotionLimits& limits,
            const Eigen::Isometry3d& flange_from_tip)
      : arm_model_(std::move(arm_model)),
        kinematics_(kinematics),
        limits_(limits),
        tip_from_flange_(flange_from_tip.inverse()) {}

  // The joints at a pose near others; false if it is out of reach.
  bool JointsAt(const Eigen::Isometry3d& base_from_tip, const Joints& near, Joints* joints) const;
  Eigen::Isometry3d TipAt(const Joints& joints) const;

  // Follows the line at `speed_m_s`, beginning with *joints, which become those of the end. `what` names the
  // line in messages ("the approach"). OUT_OF_RANGE with value and limit. Where `may_slow`, the arm goes
  // slower where its joints demand it (LimitedCartesianSpeed), down to a tenth. *wrist_3_beyond is +1 or -1 if only
  // wrist 3 would turn beyond its upper or lower limit; else 0.
  absl::Status Follow(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                      bool may_slow, const std::string& what, Joints* joints, int* wrist_3_beyond) const;

 private:
  absl::Status OutOfReach(const Eigen::Isometry3d& base_from_tip, const std::string& what) const;
  absl::Status CheckTips(const Eigen::Isometry3d& base_from_tip, const std::string& what) const;

  std::string arm_model_;
  UrKinematics kinematics_;
  MotionLimits limits_;
  Eigen::Isometry3d tip_from_flange_;
};

// "(0.300, 0.000, 0.100)"
std::string PointText(const Eigen::Vector3d& point_m);

}  // namespace touchstone::gateway::arm
