// The physical source without its protocol: one arm, one end effector, one camera, one object on a fixture,
// and a journal that knows of every touch.
//
// A touch: check, journal the intent, go to the start, arm the end effector, approach, stop when every finger
// has reported or the stroke ends, retreat, journal the result. See README.md for what happens when something
// breaks.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/gateway/arm/arm.h"
#include "server/gateway/arm/motion_planner.h"
#include "server/gateway/audit/audit_log.h"
#include "server/gateway/camera/camera.h"
#include "server/gateway/effector/effector.h"
#include "server/geometry/mesh.h"
#include "server/session/journal.h"
#include "server/source/rig_device.h"

namespace touchstone {

struct RigOptions {
  int fingers = 3;
  double spacing_m = 0.030;
  double time_scale = 1;  // rig seconds in one host second; above 1 only with an emulator on a faster clock
  double max_press_m = 0.045;  // how far the first finger may be pushed while the others are on their way
  // Run to change the object: program and arguments, in which {object} and {placement} stand for themselves.
  // Empty: a person does it and tells (Mount).
  std::vector<std::string> mount_command;
  double mount_timeout_s = 120;
  std::string source_note;  // who made the data; an emulator says here that it is one
  std::string effector_port;
};

struct RigParts {
  std::unique_ptr<Signal> news;
  std::unique_ptr<Arm> arm;
  std::unique_ptr<Effector> effector;
  std::unique_ptr<CameraDevice> camera;  // null: none
  std::optional<Intrinsics> intrinsics;  // of the camera; none: an ideal pinhole of this field of view
  double vertical_fov_rad = 0.7853981633974483;
  std::unique_ptr<MotionPlanner> planner;
  std::unique_ptr<Journal> journal;
  std::unique_ptr<AuditLog> audit;
};

class Rig : public RigDevice {
 public:
  // Reconciles what an interruption left in the journal. The parts may still be connecting.
  static absl::StatusOr<std::unique_ptr<Rig>> Create(RigOptions options, RigParts parts);
  ~Rig() override;

  // Makes the touch, or finds it done in the journal. One motion at a time: others wait for it, as long as
  // their guard holds. UNAVAILABLE: a part failed, and the same command may be given again.
  absl::StatusOr<JournalTouch> Touch(const TouchCommand& command, const MotionGuard& guard) override;
  // The journalled touch of that id, if it is done.
  absl::StatusOr<std::optional<JournalTouch>> FindDone(const TouchCommand& command) const;

  // Moves the camera there and takes a picture, which is journalled as it came.
  absl::StatusOr<Frame> Photograph(const ViewCommand& command, const MotionGuard& guard) override;
  bool has_camera() const override { return parts_.camera != nullptr; }
  Intrinsics IntrinsicsOf(const Frame& frame) const override;
  int fingers() const override { return options_.fingers; }
  double spacing_m() const override { return options_.spacing_m; }
  bool moves() const override { return true; }
  SourceStatus Status() const override;

  // Puts (mount_command) or notes the object. Home first if the rig does it.
  absl::Status Mount(const std::string& object, const std::string& placement, const MotionGuard& guard);
  absl::Status Home(const MotionGuard& guard);

  // Every check of a touch without motion, from `from` (null: from where the arm is) and for the placement
  // that it needs.
  absl::StatusOr<PlannedTouch> Check(const std::string& object, const Bounds& bounds,
                                     const CommandedTouch& touch, const ArmState* from,
                                     const std::string& where) const;

  // Stops everything, now; never waits for anything. Returns how many motions were under way. What is ordered
  // later is refused until Resume.
  uint32_t Stop(const std::string& reason, const std::string& who);
  void Resume();

  // "idle", "busy", "stopped", "protective_stop", ... (control.proto).
  std::string State() const override;

  const RigOptions& options() const { return options_; }
  const Arm& arm() const { return *parts_.arm; }
  const Effector& effector() const { return *parts_.effector; }
  const CameraDevice* camera() const { return parts_.camera.get(); }
  const MotionPlanner& planner() const { return *parts_.planner; }
  Journal& journal() const { return *parts_.journal; }
  AuditLog& audit() const { return *parts_.audit; }
  std::string SourceInWords() const;  // for a session's head

 private:
  Rig(RigOptions options, RigParts parts) : options_(std::move(options)), parts_(std::move(parts)) {}
  absl::Status Reconcile();
  absl::Status ReconcileTouch(const std::string& session, const JournalTouch& touch);

  // Holds the rig for one motion; CANCELLED or whatever the guard says while it waits for another one.
  absl::StatusOr<std::unique_lock<std::timed_mutex>> TakeRig(const MotionGuard& guard);
  // The guard, and that nobody has stopped the rig since `stops`.
  absl::Status Allowed(const MotionGuard& guard, uint64_t stops) const;
  // Powers the arm on and releases its brakes if they are not: only ever for somebody who may move it now.
  absl::Status PowerUp(const MotionGuard& guard);
  absl::Status EnsureMounted(const std::string& object, const std::string& placement,
                             const MotionGuard& guard);
  absl::Status MoveHome(const MotionGuard& guard);
  absl::Status MoveThrough(const std::vector<Eigen::Isometry3d>& poses,
                           const std::vector<std::array<double, 6>>& joints, double duration_s,
                           const MotionGuard& guard);
  uint32_t NextProgramId();
  absl::Status EnsureSession(const std::string& name);
  // Rig seconds since the session's first touch began.
  absl::StatusOr<double> SessionTimeS(const std::string& session, double unix_s);

  // touch_cycle.cpp
  absl::StatusOr<JournalResult> MakeTouch(const PlannedTouch& plan, uint32_t program_id,
                                          const TouchCommand& command, const MotionGuard& guard);
  // Beats and watches until `done` says so; stops the arm and tells why on anything else. `limit_s`: host
  // time.
  absl::Status Supervise(uint32_t program_id, double limit_s, const char* what, const MotionGuard& guard,
                         const std::function<absl::StatusOr<bool>(const ArmState&)>& done);
  void Remember(const absl::Status& status);

  const RigOptions options_;
  RigParts parts_;
  std::timed_mutex moving_;           // held by the one that moves
  std::atomic<bool> stopped_{false};  // until Resume
  std::atomic<uint64_t> stops_{0};
  std::atomic<uint32_t> motions_{0};  // under way
  std::atomic<double> last_beat_s_{0};
  mutable std::mutex status_mutex_;
  SourceStatus status_;
  std::mutex sessions_mutex_;
  std::set<std::string> sessions_;  // known to be in the journal
  uint32_t next_program_id_ = 1, reserved_program_id_ = 0;
};

// --- touch_result.cpp: what the recorded states and contacts say of a touch. Pure functions.

struct TouchRecording {
  ArmTouch motion;
  double acceleration_m_s2 = 0;
  double time_scale = 1;
  uint32_t tick_hz = 1;
  EffectorTouch contacts;
  ClockEstimate effector_clock;    // device seconds on host seconds
  ClockEstimate controller_clock;  // controller seconds on host seconds
  std::vector<ArmState> states;    // of the whole touch, oldest first
};

// Contact times since the approach began, poses at contact, speed, uncertainties (rig seconds). Session and
// Unix times stay 0. FAILED_PRECONDITION if the controller scaled the speed during the approach: times would
// not be comparable.
absl::StatusOr<JournalResult> ResultOf(const TouchRecording& record);

// base_from_tip between the two states round a controller time; nothing if they do not enclose it within 0.1
// rig s.
std::optional<Eigen::Isometry3d> PoseAt(const std::vector<ArmState>& states, double controller_s,
                                        double max_gap_s);

}  // namespace touchstone
