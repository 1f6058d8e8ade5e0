// Whether the tip can follow a straight line, or the joints theirs: inside the boxes of tips and arm, reachable without
// a jump of the joints, within the joints' limits and speeds and those of the arm's body. Samples every 5 mm and 2 deg.
#pragma once

#include <array>
#include <string>
#include <utility>

#include <absl/status/status.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/kinematics/arm_body.h"
#include "server/gateway/arm/kinematics/kinematics.h"
#include "server/gateway/arm/kinematics/motion_limits.h"
#include "server/gateway/arm/motion/singularity.h"
#include "server/gateway/calibration/calibration.h"

namespace touchstone::gateway::arm {

class LineCheck {
 public:
  LineCheck(UrKinematics kinematics, const MotionLimits& limits, const calibration::Calibration& calibration)
      : kinematics_(std::move(kinematics)),
        limits_(limits),
        body_(limits, calibration),
        tip_from_flange_(calibration.flange_from_tip.inverse()) {}

  // The joints at a pose near others; false if it is out of reach.
  bool JointsAt(const Eigen::Isometry3d& base_from_tip, const Joints& near, Joints* joints) const;
  Eigen::Isometry3d TipAt(const Joints& joints) const;

  // Follows the line at `speed_m_s`, beginning with *joints, which become those of the end. `what` names the
  // line in messages ("the approach"). OUT_OF_RANGE with value and limit; also for a turn beyond kMaxLineTurnRad. Where `may_slow`, the arm goes
  // slower where its joints or its body demand it (LimitedCartesianSpeed), down to a tenth. *wrist_3_beyond is +1 or -1
  // if only wrist 3 would turn beyond its upper or lower limit; else 0. `watch`, unless null, sees every sample.
  absl::Status Follow(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                      bool may_slow, const std::string& what, Joints* joints, int* wrist_3_beyond,
                      SingularityWatch* watch = nullptr) const;
  // Turns all joints evenly from one to the other. No fingertip may come lower than `floor_m`, base frame.
  absl::Status FollowJoints(const Joints& from, const Joints& to, double floor_m,
                            const std::string& what) const;

  const UrKinematics& kinematics() const { return kinematics_; }
  const ArmBody& body() const { return body_; }
  // Middle, first and last finger's tip, base frame.
  std::array<Eigen::Vector3d, 3> Tips(const Eigen::Isometry3d& base_from_tip) const;

 private:
  absl::Status OutOfReach(const Eigen::Isometry3d& base_from_tip, const std::string& what) const;
  absl::Status CheckTips(const Eigen::Isometry3d& base_from_tip, const std::string& what) const;
  absl::Status CheckStep(const Joints& from, const Joints& to, double step_s, double max_slowing,
                         double speed_m_s, const Eigen::Vector3d& tip_m, const std::string& what) const;
  // The largest share of its speed that a joint needs for a step that takes so long.
  double FastShare(const Joints& from, const Joints& to, double step_s) const;
  absl::Status CheckBodyStep(const BodyPoints& from, const BodyPoints& to, double step_s, double max_slowing,
                             double speed_m_s, const std::string& what) const;
  // OUT_OF_RANGE names the joint beyond its limits; *wrist_3_beyond as in Follow.
  absl::Status CheckJointLimits(const Joints& joints, const std::string& what, int* wrist_3_beyond) const;

  UrKinematics kinematics_;
  MotionLimits limits_;
  ArmBody body_;
  Eigen::Isometry3d tip_from_flange_;
};

// "(0.300, 0.000, 0.100)"
std::string PointText(const Eigen::Vector3d& point_m);

}  // namespace touchstone::gateway::arm
