// The arm, whatever its make: its states, and the few motions that a touch needs.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "server/gateway/timing/change_notifier.h"
#include "server/gateway/timing/clock_sync.h"

namespace touchstone::gateway::arm {

// Universal Robots' names and numbers, as RTDE sends them (output robot_mode). Another number may come.
enum class RobotMode : int {
  kNoController = -1,
  kDisconnected = 0,
  kConfirmSafety = 1,
  kBooting = 2,
  kPowerOff = 3,
  kPowerOn = 4,
  kIdle = 5,  // powered, brakes on
  kBackdrive = 6,
  kRunning = 7,
  kUpdatingFirmware = 8,
};

// Likewise (output safety_mode). The numbers beyond 9 are those of Universal Robots' client library (ur_client_library,
// ur/datatypes.h) and of its ROS messages (ur_dashboard_msgs, SafetyStatus).
enum class SafetyMode : int {
  kUnspecified = 0,
  kNormal = 1,
  kReduced = 2,
  kProtectiveStop = 3,
  kRecovery = 4,
  kSafeguardStop = 5,
  kSystemEmergencyStop = 6,
  kRobotEmergencyStop = 7,
  kViolation = 8,
  kFault = 9,
  kValidateJointId = 10,
  kUndefined = 11,
  kAutomaticModeSafeguardStop = 12,
  kSystemThreePositionEnablingStop = 13,
  kPendantThreePositionEnablingStop = 14,
  kImmiEmergencyStop = 15,
  kImmiSafeguardStop = 16,
  kProfisafeWaitingForParameters = 17,
  kProfisafeAutomaticModeSafeguardStop = 18,
  kProfisafeSafeguardStop = 19,
  kProfisafeEmergencyStop = 20,
  kSafetyApiSafeguardStop = 22,
  kIoPlaneStop = 23,
};

// Of the program on the controller, likewise (output runtime_state).
enum class RuntimeState : int {
  kStopping = 0,
  kStopped = 1,
  kPlaying = 2,
  kPausing = 3,
  kPaused = 4,
  kResuming = 5,
};

// What a program of this gateway is doing; the numbers stand in a register of the controller.
enum class MotionPhase : int {
  kNone = 0,     // its settings are made; it waits for BeginMotion, at rest
  kTransit = 1,  // to the start
  kReady = 2,    // at the start and at rest; waits for BeginApproach
  kApproach = 3,
  kRetract = 4,  // back to the start
  kDone = 5,     // back at the start, at rest
};

// One state, as the controller sent it. Base frame, SI.
struct ArmState {
  double host_time_s = 0;        // when it arrived (HostNowS)
  double controller_time_s = 0;  // when it was true, the controller's clock
  Eigen::Isometry3d base_from_tip = Eigen::Isometry3d::Identity();  // with the tool's offset
  Eigen::Vector3d tip_velocity_m_s = Eigen::Vector3d::Zero();
  std::array<double, 6> joints_rad{};
  RobotMode robot_mode = RobotMode::kNoController;
  SafetyMode safety_mode = SafetyMode::kUnspecified;
  RuntimeState runtime_state = RuntimeState::kStopping;
  uint32_t robot_status_bits = 0, safety_status_bits = 0;
  // The speed is the commanded one times both: what the controller's limiter leaves of it, and the pendant's slider.
  double speed_scaling = 0, target_speed_fraction = 0;
  Eigen::Vector3d tip_force_n =
      Eigen::Vector3d::Zero();             // base frame's axes, as the controller estimates or measures it
  uint32_t program_id = 0;                 // of this gateway's program that runs or ran last
  MotionPhase phase = MotionPhase::kNone;  // of that program
};

// A touch as the arm makes it. Poses are base_from_tip.
struct ArmTouch {
  uint32_t program_id = 0;                 // above 0; another one for every touch
  std::vector<Eigen::Isometry3d> transit;  // straight lines through these; the last is the start
  Eigen::Isometry3d end = Eigen::Isometry3d::Identity();  // where the approach gives up
  double speed_m_s = 0;
  double duration_s = 0;  // expected, in all, rig seconds
};

struct ForeignPrograms {
  uint64_t count = 0;
  std::string newest;  // its name, as the controller tells it
};

// Asked right before something that starts motion goes out: its error keeps that from going and is returned. A stop
// that comes later than the answer reaches the controller behind what was sent. Null: nothing forbids it.
using StartGuard = std::function<absl::Status()>;

class Arm {
 public:
  virtual ~Arm() = default;

  // The newest state; UNAVAILABLE if there is none or the link is down or silent (frozen
  // controller), with why.
  virtual absl::StatusOr<ArmState> State() const = 0;
  // The states between two controller times, oldest first, as far back as they are kept (30 rig seconds).
  virtual std::vector<ArmState> History(double from_controller_s, double to_controller_s) const = 0;
  // Why the arm may not move now, in words for people; OK if it may: connected, powered, brakes released,
  // safety mode normal, program run possible.
  virtual absl::Status Ready() const = 0;

  // A program that is sent makes its settings (tool, payload, watchdog) and waits, at rest, in phase kNone; it moves once
  // BeginMotion was called.

  // Sends the program of a touch; it goes to the start and waits there (kReady). The caller watches State().
  virtual absl::Status StartTouch(const ArmTouch& touch, const StartGuard& guard = nullptr) = 0;
  // At kNone: the program that waits begins to move.
  virtual absl::Status BeginMotion(uint32_t program_id, const StartGuard& guard = nullptr) = 0;
  // At kReady: begins the approach.
  virtual absl::Status BeginApproach(uint32_t program_id, const StartGuard& guard = nullptr) = 0;
  // Every finger has reported: the approach stops and the tool retracts to the start (kRetract, kDone).
  virtual absl::Status EndApproach(uint32_t program_id) = 0;
  // Straight lines through these poses, then to these joints if any; kDone at the end.
  virtual absl::Status MoveThrough(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                                   const std::vector<std::array<double, 6>>& joints,
                                   const StartGuard& guard = nullptr) = 0;
  // Sends a program that frees the arm for a hand to guide it (kReady while it is free), until EndApproach, or until the
  // program ends in any other way.
  virtual absl::Status StartFreedrive(uint32_t program_id, const StartGuard& = nullptr) {
    return absl::UnimplementedError(
        absl::StrCat("program ", program_id, ": this arm cannot be guided by hand"));
  }
  // Stops whatever moves, now, from any thread: on the wire before it returns, never queued behind anything. From now on
  // no heartbeat is sent until the next program.
  virtual absl::Status Stop() = 0;
  // The same by another way than Stop takes first, for a controller that does not heed that one.
  virtual absl::Status StopOtherwise() = 0;
  // Programs that began on the controller without being sent by this object, since it was made.
  virtual ForeignPrograms Foreign() const { return {}; }
  // Powers on and releases the brakes if they are not; never unlocks a protective stop. `guard` is asked before
  // each step, with nothing between its answer and the step, and while the controller works on it. Its error ends the
  // wait and is returned, and an arm that this call was powering up is powered off again: else it would release its
  // brakes by itself.
  virtual absl::Status PowerOn(const StartGuard& guard) = 0;

  // Writes the next heartbeat to the register that the running program's watchdog on the controller observes.
  // Without heartbeats that watchdog stops the arm.
  virtual void SendHeartbeat() = 0;

  virtual timing::ClockEstimate ControllerClock() const = 0;  // controller seconds on host seconds
  virtual double StateRateHz() const = 0;
  virtual std::string Model() const = 0;  // "ur3e"
  virtual std::string Address() const = 0;
  virtual std::string Version() const = 0;  // of the controller's software
};

}  // namespace touchstone::gateway::arm
