// Watches the force on the tip during one motion.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "server/gateway/arm/arm.h"

namespace touchstone::gateway {

// What a state's force is without what the sensor shows less since it was zeroed while something pressed. `zeroed_n`: tip
// frame. Base frame's axes, N.
Eigen::Vector3d ForceOf(const arm::ArmState& state, const Eigen::Vector3d& zeroed_n);

// What the arm feels at rest: the mean over the states of the last 0.2 s, or of the last 2 s if it moved until now.
// Base frame's axes, N. Zero: no state is at rest.
Eigen::Vector3d ForceAtRest(const arm::Arm& arm, const Eigen::Vector3d& zeroed_n);

// OK, or FAILED_PRECONDITION: at rest the arm feels more than 45 % of the limit. A payload that is set wrong or something
// that presses against the tool, either way no motion should begin. (The error of an arm's sensor is at most half the
// limit: arm/kinematics/motion_limits.cpp.)
absl::Status CheckForceAtRest(const Eigen::Vector3d& at_rest_n, double max_force_n);

// What is felt at rest before the motion is subtracted: a payload that is set a little wrong, a sensor's offset. No more
// than half the limit is, so that something that presses against the tool is not taken for one. Not thread-safe.
//
// Setting a payload zeroes an e-Series' sensor (UR's script manual, set_target_payload), also while something presses.
// `zeroed_n`, what was felt at rest before that minus what was felt after it, in the tip's frame, is added to every state.
//
// A motion that begins pressed, as the way out after this guard has stopped an approach, may let go: the force may not
// grow by more than a quarter of the limit above the lowest since, until it is within the limit.
class ForceGuard {
 public:
  // `what` names the motion in messages. Looks at the arm's last states; the motion may just have begun.
  ForceGuard(const arm::Arm& arm, double max_force_n, std::string what,
             const Eigen::Vector3d& zeroed_n = Eigen::Vector3d::Zero());

  // Of every state since the last call. FAILED_PRECONDITION with the force and the limit: nothing that retries by itself
  // should press again.
  absl::Status Check(const arm::ArmState& newest);
  const Eigen::Vector3d& at_rest_n() const { return at_rest_n_; }

 private:
  absl::Status CheckState(const arm::ArmState& state);

  const arm::Arm& arm_;
  const double max_force_n_;
  double allowed_n_;  // now: the limit, or more while the motion lets go of what it began against
  const std::string what_;
  const Eigen::Vector3d zeroed_n_;
  Eigen::Vector3d at_rest_n_ = Eigen::Vector3d::Zero();
  double seen_s_ = 0;  // controller time up to which states were looked at
};

}  // namespace touchstone::gateway
