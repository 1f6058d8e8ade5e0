// The physical source without its protocol: one arm, one end effector, one camera, one object on a fixture,
// and a journal that knows of every touch.
//
// A touch: check, journal the intent, go to the start, start the end effector's capture, approach, stop when
// every finger has reported or the stroke ends, retract, journal the result. README.md says what happens
// when something breaks.
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
  double max_overtravel_m = 0.045;  // of the first finger past its contact, while the others have none yet
  // Run to change the object: program and arguments, in which {object} and {up_face} ("+x"; also {placement})
  // are replaced. Empty: a person changes it and calls Mount.
  std::vector<std::string> mount_command;
  double mount_timeout_s = 120;
  std::string provenance_note;  // who made the data; an emulator says here that it is one
  std::string effector_port;
};

struct RigParts {
  std::unique_ptr<ChangeNotifier> changes;  // of arm and end effector
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
  // Of the object on the fixture; none: unknown.
  std::optional<UpFace> MountedUpFace() const;

  // Puts (mount_command) or notes the object. Home first if the rig does it.
  absl::Status Mount(const std::string& object, UpFace up_face, const MotionGuard& caller);
  absl::Status Home(const MotionGuard& caller);
  // Powers the arm on and releases its brakes; OK once it is ready to move. FAILED_PRECONDITION says what a
  // person has to do first.
  absl::Status PowerOn(const MotionGuard& caller);

  // Every check of a touch without motion, from `from` (null: from where the arm is) and with the face up
  // that it needs.
  absl::StatusOr<PlannedTouch> Check(const std::string& object, const Bounds& bounds,
                                     const CommandedTouch& touch, const ArmState* from,
                                     const std::string& where) const;

  // Stops everything, now; never waits for anything. Returns how many motions were under way. Every motion is
  // refused (ABORTED) from now on, also by the next process on this journal, until Reset.
  uint32_t Stop(const std::string& reason, const std::string& who);
  // Releases a stop, moving nothing; without a stop it does nothing. FAILED_PRECONDITION while the controller's
  // own safety mode forbids motion, UNAVAILABLE while it cannot be asked: the stop holds then.
  absl::Status Reset(const std::string& reason, const std::string& who);
  // Who stopped it and why, for people; empty: it is not stopped.
  std::string StopReason() const;

  SourceState State() const override;

  const RigOptions& options() const { return options_; }
  const Arm& arm() const { return *parts_.arm; }
  const Effector& effector() const { return *parts_.effector; }
  const CameraDevice* camera() const { return parts_.camera.get(); }
  const MotionPlanner& planner() const { return *parts_.planner; }
  Journal& journal() const { return *parts_.journal; }
  AuditLog& audit() const { return *parts_.audit; }
  std::string Provenance() const;  // where a session's data come from: note, arm, end effector

 private:
  Rig(RigOptions options, RigParts parts) : options_(std::move(options)), parts_(std::move(parts)) {}
  absl::Status Reconcile();
  absl::Status ReconcileTouch(const std::string& session, const JournalTouch& touch);

  // The caller's guard, and that nobody has stopped the rig since this call: every motion asks it from its beginning on.
  MotionGuard UntilStopped(const MotionGuard& caller) const;
  // Holds the rig for one motion; the guard's error if that fails while it waits for another one.
  absl::StatusOr<std::unique_lock<std::timed_mutex>> TakeRig(const MotionGuard& guard);
  // Powers the arm on and releases its brakes if they are not: only ever for somebody who may move it now.
  absl::Status PowerUp(const MotionGuard& guard);
  absl::Status EnsureMounted(const std::string& object, UpFace up_face, const MotionGuard& guard);
  // What lies on the fixture now, in the journal and the audit log.
  absl::Status NoteMounted(const std::string& object, UpFace up_face);
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
  // Sends heartbeats and watches until `done` says so; stops the arm and returns why on anything else.
  // `limit_s`: host time.
  absl::Status Supervise(uint32_t program_id, double limit_s, const char* what, const MotionGuard& guard,
                         const std::function<absl::StatusOr<bool>(const ArmState&)>& done);
  void Remember(const absl::Status& status);

  // The journal's fact of who stopped the rig and why; "" once it was reset.
  static constexpr char kStopFact[] = "stop";

  const RigOptions options_;
  RigParts parts_;
  std::timed_mutex moving_;           // held by the one that moves
  std::atomic<bool> stopped_{false};  // until Reset
  std::atomic<uint64_t> stops_{0};    // how often it was stopped: a motion of before a stop never resumes
  mutable std::mutex stop_mutex_;     // of the reason, and of what the journal keeps of it
  std::string stop_reason_;
  std::atomic<uint32_t> motions_{0};  // under way
  std::atomic<double> last_heartbeat_s_{0};
  mutable std::mutex status_mutex_;
  SourceStatus status_;
  std::optional<UpFace> up_face_;  // of the object on the fixture
  std::mutex sessions_mutex_;
  std::set<std::string> sessions_;  // known to be in the journal
  uint32_t next_program_id_ = 1, reserved_program_id_ = 0;
};

}  // namespace touchstone
