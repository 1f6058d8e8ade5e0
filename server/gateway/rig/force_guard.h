// Watches the force on the tip during one motion.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "server/gateway/arm/arm.h"

namespace touchstone::gateway {

// What is felt at rest before the motion is subtracted: a payload that is set a little wrong, a sensor's offset. No more
// than half the limit is, so that something that presses against the tool is not taken for one. Not thread-safe.
//
// A motion that begins pressed, as the way out after this guard has stopped an approach, may let go: the force may not
// grow by more than a quarter of the limit above the lowest since, until it is within the limit.
class ForceGuard {
 public:
  // `what` names the motion in messages. Looks at the arm's last states; the motion may just have begun.
  ForceGuard(const arm::Arm& arm, double max_force_n, std::string what);

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
  Eigen::Vector3d at_rest_n_ = Eigen::Vector3d::Zero();
  double seen_s_ = 0;  // controller time up to which states were looked at
};

}  // namespace touchstone::gateway
