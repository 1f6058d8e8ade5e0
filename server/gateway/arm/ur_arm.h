// An arm of Universal Robots (arm_model.h) as an Arm: state over RTDE, programs over the secondary interface, power over the dashboard.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <absl/status/statusor.h>

#include "server/gateway/arm/arm.h"
#include "server/gateway/arm/kinematics/motion_limits.h"
#include "server/gateway/arm/motion/ur_script.h"
#include "server/gateway/calibration/calibration.h"

namespace touchstone::gateway::arm {

struct UrArmOptions {
  std::string model = "ur3e";  // a name of arm_model.h
  std::string address;
  int dashboard_port = 29999, primary_port = 30001, secondary_port = 30002, rtde_port = 30004;
  ScriptOptions script;                  // tool, payload, speeds, time scale
  MotionLimits body_limits;              // of these only max_arm_speed_m_s is looked at
  calibration::Calibration calibration;  // and of this only where the camera is
  double frozen_after_s = 0.5;      // host time without a state after which the controller counts as frozen
  double program_start_s = 4;       // host time that a program may take to begin: tenths, but on a busy host
  double connect_wait_s = 2;        // host time that ConnectUrArm waits for the first state
  double assumed_delay_s = 0.0005;  // of a state on its way, host time; the clock is as uncertain
};

class UrArm : public Arm {
 public:
  // The arm's own kinematics, as it was calibrated at the factory, once the controller has sent them.
  virtual std::optional<DhTable> CalibratedKinematics() const = 0;
};

// Begins to connect, and keeps trying as long as the object lives; State() says whether it is connected.
// INVALID_ARGUMENT: the options make no sense. `changes` is notified of every state and every change of the
// link; it must outlive the arm.
//
// StartTouch and MoveThrough return when the program is on the wire. If the controller does not begin it,
// State() becomes UNAVAILABLE with what the controller said, until the next program or stop. Stop() is not
// queued behind anything: it has a connection of its own, goes a second way behind a program that is just
// being sent, and falls back on the dashboard; if all fail, heartbeats are withheld so that the watchdog
// stops the program.
absl::StatusOr<std::unique_ptr<UrArm>> ConnectUrArm(const UrArmOptions& options,
                                                    timing::ChangeNotifier* changes);

}  // namespace touchstone::gateway::arm
