// The physical source without its protocol: one arm, one end effector, one camera, one object on a fixture,
// and a journal that knows of every touch.
//
// A touch: check, journal the intent, go to the start, start the end effector's capture, approach, stop when
// every finger has reported or the stroke ends, retract, journal the result. README.md says what happens
// when something breaks.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/gateway/arm/arm.h"
#include "server/gateway/arm/motion/motion_planner.h"
#include "server/gateway/audit/audit_log.h"
#include "server/gateway/camera/camera.h"
#include "server/gateway/effector/effector.h"
#include "server/gateway/rig/results/camera_pose.h"
#include "server/gateway/rig/watches/arm_watch.h"
#include "server/gateway/rig/watches/heartbeats.h"
#include "server/gateway/rig/watches/session_clock.h"
#include "server/gateway/rig/watches/unwritten_outcomes.h"
#include "server/geometry/mesh/mesh.h"
#include "server/session/journal/journal.h"
#include "server/source/rig_device.h"

namespace touchstone::gateway {

struct RigOptions {
  int fingers = 3;
  double spacing_m = 0.030;
  double time_scale = 1;  // rig seconds in one host second; above 1 only with an emulator on a faster clock
  double max_overtravel_m = 0.045;  // of the first finger past its contact, while the others have none yet
  // Run to change the object: program and arguments, in which {object} and {up_face} ("+x"; also {placement})
  // are replaced. Empty: a person changes it and calls Mount.
  std::vector<std::string> mount_command;
  double mount_timeout_s = 120;
  std::string provenance_note;  // who made the data
  bool emulated = false;        // an emulator is in the rig's place: every session says so
  std::string effector_port;
  CameraPoseTolerance camera_tolerance;       // of photographs
  const Clock* clock = &timing::HostClock();  // outlives the rig
  // The box of an object by its name, object frame; none: not known. Null: none is.
  std::function<std::optional<geometry::Bounds>(const std::string&)> bounds_of;
};

struct RigParts {
  std::unique_ptr<timing::ChangeNotifier> changes;  // of arm and end effector
  std::unique_ptr<arm::Arm> arm;
  std::unique_ptr<effector::Effector> effector;
  std::unique_ptr<camera::CameraDevice> camera;  // null: none
  std::optional<image::Intrinsics> intrinsics;  // of the camera; none: an ideal pinhole of this field of view
  double vertical_fov_rad = 0.7853981633974483;
  std::unique_ptr<arm::MotionPlanner> planner;
  std::unique_ptr<session::Journal> journal;
  std::unique_ptr<audit::AuditLog> audit;
};

struct StopOutcome {
  uint32_t motions = 0;  // that were under way
  absl::Status
      standstill;  // OK: the arm was seen at rest after the stop, with no program that runs; else why not
};

class Rig : public source::RigDevice {
 public:
  // Reconciles what an interruption left in the journal. The parts may still be connecting.
  static absl::StatusOr<std::unique_ptr<Rig>> Create(RigOptions options, RigParts parts);
  ~Rig() override;

  // Makes the touch, or finds it done in the journal. One motion at a time: others wait for it, as long as
  // their guard holds. UNAVAILABLE: a part failed, and the same command may be given again.
  absl::StatusOr<session::JournalTouch> Touch(const source::TouchCommand& command,
                                              const source::MotionGuard& guard) override;
  // The journalled touch of that id, if it is done.
  absl::StatusOr<std::optional<session::JournalTouch>> FindDone(const source::TouchCommand& command) const;

  // Moves the camera there and takes a picture, which is journalled as it came, with the pose that the arm's states
  // show meanwhile.
  absl::StatusOr<source::Photograph> Photograph(const source::ViewCommand& command,
                                                const source::MotionGuard& guard) override;
  absl::StatusOr<std::optional<session::JournalSeries>> Series(const std::string& session,
                                                               const std::string& id) const override {
    return parts_.journal->Series(session, id);
  }
  bool has_camera() const override { return parts_.camera != nullptr; }
  image::Intrinsics IntrinsicsOf(const image::Frame& frame) const override;
  int fingers() const override { return options_.fingers; }
  double spacing_m() const override { return options_.spacing_m; }
  bool moves() const override { return true; }
  source::SourceStatus Status() const override;
  // Of the object on the fixture; none: unknown.
  std::optional<calibration::UpFace> MountedUpFace() const;

  // Puts (mount_command) or notes the object. Home first if the rig does it.
  absl::Status Mount(const std::string& object, calibration::UpFace up_face,
                     const source::MotionGuard& caller);
  absl::Status Home(const source::MotionGuard& caller);
  // Frees the arm for a hand to guide it, and reports where it is some twenty times a second, until the guard's error,
  // which is returned.
  absl::Status Guide(const std::function<void(const arm::ArmState&)>& report,
                     const source::MotionGuard& caller);
  // Powers the arm on and releases its brakes; OK once it is ready to move. FAILED_PRECONDITION says what a
  // person has to do first. Nothing else ever does: a motion on an arm without power is refused.
  absl::Status PowerOn(const source::MotionGuard& caller);

  // A dry run: where the arm would be, and what would lie there.
  struct DryRun {
    arm::ArmState at;
    std::string object;
    std::optional<calibration::UpFace> up_face;
  };
  absl::StatusOr<DryRun> BeginDryRun() const;
  // The object, with this face up. A rig that puts objects down by itself goes home before it turns or changes one.
  absl::Status MountInDryRun(const std::string& object, calibration::UpFace up_face, DryRun* run) const;

  // Every check of a touch without motion, from `from` (null: from where the arm is) and with the face up
  // that it needs.
  absl::StatusOr<arm::PlannedTouch> Check(const std::string& object, const geometry::Bounds& bounds,
                                          const touch::CommandedTouch& touch, const arm::ArmState* from,
                                          const std::string& where) const;

  // The same of a photograph.
  absl::StatusOr<arm::PlannedTouch> CheckView(const source::ViewCommand& command, const arm::ArmState* from,
                                              const std::string& where) const;

  // Stops everything, now; what is sent waits for nothing. Then it looks until the arm stands still, tries another way if
  // the arm does not heed the first, and gives up after 1.5 s. Every motion is refused (ABORTED) from now on, also by the
  // next process on this journal, until Reset.
  //
  // The same latch closes by itself: for what ArmWatch finds, and when a motion came to an end that this gateway neither
  // commanded nor saw done: its program was ended or paused, the link to the controller was lost, the gateway hung, was
  // told to end, or ended before this process began.
  StopOutcome Stop(const std::string& reason, const std::string& who);
  // The process is told to end: no motion begins any more, and what is under way is stopped and latches.
  void Close();
  // Releases a stop, moving nothing; without a stop it does nothing. FAILED_PRECONDITION while the controller's
  // own safety mode forbids motion, UNAVAILABLE while it cannot be asked: the stop holds then.
  absl::Status Reset(const std::string& reason, const std::string& who);
  // Who or what stopped it and why, for people: "by ana@lab rig-stop 4711 (cable caught)"; empty: it is not stopped.
  std::string StopReason() const;

  source::SourceState State() const override;

  const RigOptions& options() const { return options_; }
  const arm::Arm& arm() const { return *parts_.arm; }
  const effector::Effector& effector() const { return *parts_.effector; }
  const camera::CameraDevice* camera() const { return parts_.camera.get(); }
  const arm::MotionPlanner& planner() const { return *parts_.planner; }
  session::Journal& journal() const { return *parts_.journal; }
  audit::AuditLog& audit() const { return *parts_.audit; }
  std::string Provenance() const;  // where a session's data come from: note, arm, end effector

 private:
  Rig(RigOptions options, RigParts parts)
      : options_(std::move(options)),
        parts_(std::move(parts)),
        unwritten_(parts_.journal.get()),
        session_clock_(parts_.journal.get(), options_.time_scale) {}
  absl::Status Reconcile();
  absl::Status ReconcileTouch(const std::string& session, const session::JournalTouch& touch);

  // The caller's guard, and that nobody has stopped the rig since this call: every motion asks it from its
  // beginning on.
  source::MotionGuard UntilStopped(const source::MotionGuard& caller) const;
  // Holds the rig for one motion; the guard's error if that fails while it waits for another one.
  absl::StatusOr<std::unique_lock<std::timed_mutex>> TakeRig(const source::MotionGuard& guard);
  // Why the arm may not move now for somebody whose guard this is; OK: it may.
  absl::Status ReadyToMove(const source::MotionGuard& guard);
  // The path of a touch, if nothing forbids it; nothing but the object was moved.
  absl::StatusOr<arm::PlannedTouch> Admit(const source::TouchCommand& command, calibration::UpFace up_face,
                                          const source::MotionGuard& guard);
  // Notes in the audit log why a touch did not begin, once for each that is refused again and again; returns why.
  absl::Status Refused(const source::TouchCommand& command, const absl::Status& why);
  absl::Status PowerUp(const source::MotionGuard& guard);
  // Where another object or another resting face is needed the arm goes home first; then the mount command changes it, or
  // FAILED_PRECONDITION tells a person what to put down.
  absl::Status EnsureMounted(const std::string& object, calibration::UpFace up_face,
                             const source::MotionGuard& guard);
  // What lies on the fixture now, in the journal and the audit log.
  absl::Status NoteMounted(const std::string& object, calibration::UpFace up_face);
  absl::Status NoteNothingMounted();
  absl::Status MoveHome(const source::MotionGuard& guard);
  absl::StatusOr<bool> AtHome() const;
  absl::Status MoveThrough(const std::vector<Eigen::Isometry3d>& poses,
                           const std::vector<std::array<double, 6>>& joints, double duration_s,
                           const source::MotionGuard& guard);
  // Another one than the controller's registers show. Refused where it could be used again after a restart: the journal
  // must know of it.
  absl::StatusOr<uint32_t> NextProgramId();
  // The states of after that time of the controller that have arrived, and the next one.
  std::vector<arm::ArmState> StatesAfter(double controller_s) const;
  absl::Status EnsureSession(const std::string& name);

  // touch_cycle.cpp
  absl::StatusOr<session::JournalResult> MakeTouch(const arm::PlannedTouch& plan, uint32_t program_id,
                                                   const source::TouchCommand& command,
                                                   const source::MotionGuard& guard,
                                                   std::optional<session::JournalSeries>* series);
  void Remember(const absl::Status& status);

  // supervise.cpp
  // A program of the gateway on the controller, from its sending on.
  struct Program {
    uint32_t id = 0;
    source::MotionGuard guard;
    double max_force_n = 0;  // infinite: the force is a hand's
    bool let_go = false;     // it was told to move
    double hung_s = 0;       // the longest hang of its supervisor, host time; 0: none
    double hung_at_s = 0;    // when that ended
  };
  // What every wait of a motion asks, every 10 ms or oftener: renews the permit of the heartbeats, and returns why the
  // motion may not go on (the controller's safety mode, its guard).
  absl::Status MayGoOn(const source::MotionGuard& guard);
  // Sends a program, waits until it has made its settings, looks at the force at rest, and lets it move.
  absl::Status Launch(Program* program, const char* what,
                      const std::function<absl::Status(const arm::StartGuard&)>& send);
  // Watches until `done` says so; gives up on anything else. `limit_s`: host time.
  absl::Status Supervise(Program* program, double limit_s, const char* what,
                         const std::function<absl::StatusOr<bool>(const arm::ArmState&)>& done);
  // Stops the arm, latches unless this gateway itself ended the motion, and returns `why` and what was wrong with the stop.
  absl::Status GiveUp(Program* program, const char* what, const absl::Status& why);
  // After a stop that was sent at `from_s`, the controller's time: waits until the arm is at rest, and sends a stop by
  // another way if it does not heed the first. UNAVAILABLE: it was not seen at rest within 1.5 s, or cannot be asked.
  absl::Status ConfirmStandstill(double from_s);
  double ControllerNowS() const;  // of the newest state; 0: there is none

  // rig_safety.cpp
  // Closes the latch of Stop; `what` is "by WHOM (WHY)", and is added to what closed it before.
  void Latch(const std::string& what);
  void LatchLoss(const std::string& what);  // of the arm's controller
  // Latches what the controller's states since the last look tell; `asked`: a motion is being asked for now.
  void LookAtSafety(bool asked = false);
  // A protective or safeguard stop pauses a program on a UR, and the pendant could go on with it: one that was given up
  // is ended as soon as the controller lets it.
  void EndPausedProgram();
  void WatchSafety();  // the thread
  // Before anything else at the start: latches if a motion was under way when the process before this one ended.
  // Before anything stops: a motion that is ended says who or what ended it, though the journal, whose disk may be slow, keeps
  // the reason only later. "": it is kept.
  void SayWhy(const std::string& what);
  absl::Status LatchInterruption();
  absl::Status LatchUnlessItEnded(uint32_t program_id, const std::string& what);

  // The journal's record of who stopped the rig and why; "" once it was reset.
  static constexpr char kStopKey[] = "stop";
  // Of the last motion that is no touch: its program's id (0: power) and what it was; "" once it has failed.
  static constexpr char kMotionKey[] = "motion_under_way";

  double NowS() const { return options_.clock->NowS(); }  // host time

  const RigOptions options_;
  RigParts parts_;
  UnwrittenOutcomes unwritten_;
  SessionClock session_clock_;
  std::timed_mutex moving_;           // held by the one that moves
  std::atomic<bool> stopped_{false};  // until Reset
  std::atomic<uint64_t> stops_{0};    // how often it was stopped: a motion of before a stop never resumes
  mutable std::mutex stop_mutex_;     // of the reason, and of what the journal keeps of it
  std::string stop_reason_;
  mutable std::mutex stopping_mutex_;  // never held over a write
  std::string stopping_;               // of a stop whose reason is not kept yet
  std::string not_released_;           // at the end of it, after a release that could not be written
  int failed_releases_ = 0;
  std::atomic<uint32_t> motions_{0};  // under way
  mutable std::mutex status_mutex_;
  source::SourceStatus status_;
  std::string last_refusal_;                    // session, id and why
  std::optional<calibration::UpFace> up_face_;  // of the object on the fixture
  std::mutex sessions_mutex_;
  std::string last_session_;  // whose fingers and spacing are this rig's
  uint32_t next_program_id_ = 1, reserved_program_id_ = 0;

  std::mutex safety_mutex_;  // of what LookAtSafety knows
  ArmWatch watch_;
  std::atomic<bool> powering_{false};      // PowerUp is under way
  std::atomic<bool> closing_{false};       // Close was called
  std::atomic<uint32_t> given_up_{0};      // the program that was given up last; 0: none
  std::atomic<bool> left_pressed_{false};  // the last motion did not come to its end: the tool may press
  Eigen::Vector3d zeroed_n_ =
      Eigen::Vector3d::Zero();   // ForceGuard: by the last program; of the one that moves
  double paused_stop_s_ = -1e9;  // host time at which EndPausedProgram sent a stop
  std::mutex watch_mutex_;
  std::condition_variable watch_ends_;
  bool ending_ = false;
  // Last: their threads use what stands above.
  std::unique_ptr<Heartbeats> heartbeats_;
  std::thread safety_thread_;
};

}  // namespace touchstone::gateway
