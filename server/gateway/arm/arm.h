// The arm, whatever its make: what it tells of itself, and the few motions that a touch needs.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/timing/change_notifier.h"
#include "server/gateway/timing/clock_sync.h"

namespace touchstone {

// One state, as the controller sent it. Base frame, SI.
struct ArmState {
  double host_time_s = 0;        // when it arrived (HostNowS)
  double controller_time_s = 0;  // when it was true, the controller's clock
  Eigen::Isometry3d base_from_tip = Eigen::Isometry3d::Identity();  // with the tool's offset
  Eigen::Vector3d tip_velocity_m_s = Eigen::Vector3d::Zero();
  std::array<double, 6> joints_rad{};
  int robot_mode = -1;    // RIG.md: 7 running
  int safety_mode = 0;    // 1 normal, 3 protective stop ...
  int runtime_state = 0;  // 1 stopped, 2 playing
  uint32_t robot_status_bits = 0, safety_status_bits = 0;
  double speed_scaling = 0;
  uint32_t program_id = 0;  // of this gateway's program that runs or ran last
  int phase = 0;            // MotionPhase of it
};

// What a program of ours is doing; the numbers stand in a register of the controller.
enum class MotionPhase : int {
  kNone = 0,
  kTransfer = 1,  // to the start
  kReady = 2,     // at the start and at rest; waits for BeginApproach
  kApproach = 3,
  kRetreat = 4,
  kDone = 5,  // back at the start, at rest
};
const char* PhaseName(int phase);  // "transfer"; "unknown" for another number

// A touch as the arm makes it. Poses are base_from_tip.
struct ArmTouch {
  uint32_t program_id = 0;                  // above 0; another one for every touch
  std::vector<Eigen::Isometry3d> transfer;  // straight lines through these; the last is the start
  Eigen::Isometry3d end = Eigen::Isometry3d::Identity();  // where the approach gives up
  double speed_m_s = 0;
  double duration_s = 0;  // expected, in all, rig seconds
};

class Arm {
 public:
  virtual ~Arm() = default;

  // The newest state; UNAVAILABLE if there is none or the link is down or silent (frozen controller), with
  // why.
  virtual absl::StatusOr<ArmState> State() const = 0;
  // The states between two controller times, oldest first, as far back as they are kept (30 rig seconds).
  virtual std::vector<ArmState> History(double from_controller_s, double to_controller_s) const = 0;
  // Why the arm may not move now, in words for people; OK if it may: connected, powered, brakes released,
  // safety mode normal, program run possible.
  virtual absl::Status Ready() const = 0;

  // Sends the program of a touch; it goes to the start and waits there (kReady). The caller watches State().
  virtual absl::Status StartTouch(const ArmTouch& touch) = 0;
  // At kReady: begins the approach.
  virtual absl::Status BeginApproach(uint32_t program_id) = 0;
  // Every finger has reported: the approach stops and the tool retreats to the start (kRetreat, kDone).
  virtual absl::Status EndApproach(uint32_t program_id) = 0;
  // Straight lines through these poses, then to these joints if any; kDone at the end.
  virtual absl::Status MoveThrough(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                                   const std::vector<std::array<double, 6>>& joints) = 0;
  // Stops whatever moves, now, from any thread: on the wire before it returns, never queued behind anything.
  virtual absl::Status Stop() = 0;
  // Powers on and releases the brakes if they are not; never unlocks a protective stop.
  virtual absl::Status PowerOn() = 0;

  // The gateway lives: written to the controller's watchdog register until this is no longer called. The
  // watchdog of a running program stops the arm then.
  virtual void Beat() = 0;

  virtual ClockEstimate ControllerClock() const = 0;  // controller seconds on host seconds
  virtual double StateRateHz() const = 0;
  virtual std::string Model() const = 0;  // "ur3e"
  virtual std::string Address() const = 0;
  virtual std::string Version() const = 0;  // of the controller's software
};

}  // namespace touchstone
