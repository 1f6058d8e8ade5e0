#include "server/gateway/rig/rig.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <limits>
#include <random>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/session/journal/command_bytes.h"

namespace touchstone::gateway {
namespace {

// Program ids are taken from the journal in blocks, so that no id is ever used twice, whatever happens. A new journal
// begins anywhere in their range: the controller's registers keep what a program of another journal left there.
constexpr uint32_t kProgramIdBlock = 1000;
constexpr uint32_t kMaxProgramId = (1u << 28) - kProgramIdBlock;

uint32_t RandomProgramId() {
  std::random_device random;
  return std::uniform_int_distribution<uint32_t>(1, kMaxProgramId - kProgramIdBlock)(random);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Rig>> Rig::Create(RigOptions options, RigParts parts) {
  std::unique_ptr<Rig> rig(new Rig(std::move(options), std::move(parts)));
  session::Journal& journal = rig->journal();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string next, journal.Metadata("next_program_id"));
  if (next.empty()) rig->next_program_id_ = RandomProgramId();
  if (!next.empty() && !absl::SimpleAtoi(next, &rig->next_program_id_))
    return absl::DataLossError(
        absl::StrCat("the journal's next_program_id is '", next, "': a number was expected"));
  rig->reserved_program_id_ = rig->next_program_id_;
  TOUCHSTONE_ASSIGN_OR_RETURN(rig->status_.object, journal.Metadata("mounted_object"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string up_face, journal.Metadata("mounted_placement"));
  if (!up_face.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(rig->up_face_,
                                calibration::ParseUpFace(up_face, "the journal's mounted_placement"));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(rig->stop_reason_, journal.Metadata(kStopKey));
  rig->stopped_ = !rig->stop_reason_.empty();
  if (rig->stopped_) spdlog::warn("still stopped {}; touchstone rig reset releases it", rig->stop_reason_);
  rig->heartbeats_ = std::make_unique<Heartbeats>([arm = rig->parts_.arm.get()] { arm->SendHeartbeat(); },
                                                  *rig->options_.clock);
  TOUCHSTONE_RETURN_IF_ERROR(rig->LatchInterruption());
  TOUCHSTONE_RETURN_IF_ERROR(rig->Reconcile());
  rig->safety_thread_ = std::thread([&rig = *rig] { rig.WatchSafety(); });
  return rig;
}

Rig::~Rig() {
  {
    std::lock_guard<std::mutex> lock(watch_mutex_);
    ending_ = true;
  }
  watch_ends_.notify_all();
  if (safety_thread_.joinable()) safety_thread_.join();
  Close();
}

absl::StatusOr<uint32_t> Rig::NextProgramId() {
  if (next_program_id_ >= kMaxProgramId) next_program_id_ = reserved_program_id_ = 1;
  if (next_program_id_ >= reserved_program_id_) {
    const uint32_t reserved = next_program_id_ + kProgramIdBlock;
    TOUCHSTONE_RETURN_IF_ERROR(journal().SetMetadata("next_program_id", absl::StrCat(reserved)));
    reserved_program_id_ = reserved;
  }
  const uint32_t id = next_program_id_++;
  // What an earlier program left in the controller's registers must never pass for this one's.
  const absl::StatusOr<arm::ArmState> arm = parts_.arm->State();
  if (arm.ok() && arm->program_id == id) return NextProgramId();
  return id;
}

std::optional<calibration::UpFace> Rig::MountedUpFace() const {
  std::lock_guard<std::mutex> lock(status_mutex_);
  return up_face_;
}

void Rig::Remember(const absl::Status& status) {
  std::lock_guard<std::mutex> lock(status_mutex_);
  status_.last_error = std::string(status.message());
}

source::SourceStatus Rig::Status() const {
  source::SourceStatus status;
  {
    std::lock_guard<std::mutex> lock(status_mutex_);
    status = status_;
  }
  const timing::ClockEstimate clock = parts_.effector->Clock();
  if (clock.valid) status.clock_uncertainty_s = clock.offset_uncertainty_s / clock.rate * options_.time_scale;
  return status;
}

absl::Status Rig::EnsureSession(const std::string& name) {
  std::lock_guard<std::mutex> lock(sessions_mutex_);
  // It may have been deleted since.
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool there, journal().HasSession(name));
  if (there && name == last_session_) return absl::OkStatus();
  session::JournalSession session;
  session.name = name;
  session.created_unix_s = timing::UnixNowS();
  session.provenance = Provenance();
  session.emulated = options_.emulated;
  session.calibration = calibration::FormatCalibration(parts_.planner->calibration());
  session.fingers = options_.fingers;
  session.spacing_m = options_.spacing_m;
  TOUCHSTONE_RETURN_IF_ERROR(journal().EnsureSession(session));
  last_session_ = name;
  return absl::OkStatus();
}

std::string Rig::Provenance() const {
  const effector::EffectorState effector = parts_.effector->State();
  return absl::StrCat(options_.provenance_note, options_.provenance_note.empty() ? "" : "; ",
                      parts_.arm->Model(), " at ", parts_.arm->Address(), ", end effector ",
                      effector.firmware, " at ", options_.effector_port);
}

absl::StatusOr<std::optional<session::JournalTouch>> Rig::FindDone(
    const source::TouchCommand& command) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<session::JournalTouch> touch,
                              parts_.journal->Find(command.session, command.id));
  if (!touch.has_value()) return touch;
  if (touch->object != command.object || !session::SameCommand(touch->command, command.bytes))
    return absl::AlreadyExistsError(absl::StrCat("touch id '", command.id, "' of session '", command.session,
                                                 "' stands for another touch already: take a new id"));
  if (touch->stage == session::TouchStage::kExecuting)
    TOUCHSTONE_RETURN_IF_ERROR(unwritten_.Kept(command.session, command.id));
  if (touch->stage != session::TouchStage::kDone) return std::optional<session::JournalTouch>();
  return touch;
}

absl::StatusOr<arm::PlannedTouch> Rig::Admit(const source::TouchCommand& command, calibration::UpFace up_face,
                                             const source::MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(ReadyToMove(guard));
  if (const effector::EffectorState effector = parts_.effector->State(); !effector.connected)
    return absl::UnavailableError(absl::StrCat("the end effector is not there: ", effector.why));
  TOUCHSTONE_RETURN_IF_ERROR(EnsureMounted(command.object, up_face, guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState from, parts_.arm->State());
  return parts_.planner->Plan(from, command.object, command.bounds, up_face, command.touch,
                              "touch '" + command.id + "'");
}

absl::Status Rig::Refused(const source::TouchCommand& command, const absl::Status& why) {
  const std::string refusal = absl::StrCat(command.session, "\n", command.id, "\n", why.message());
  {
    // A client that asks in a loop does not fill the disk.
    std::lock_guard<std::mutex> lock(status_mutex_);
    if (refusal == last_refusal_) return why;
    last_refusal_ = refusal;
  }
  audit()
      .Write("touch_refused", {{"session", command.session},
                               {"id", command.id},
                               {"code", absl::StatusCodeToString(why.code())},
                               {"why", std::string(why.message())}})
      .IgnoreError();
  return why;
}

absl::StatusOr<session::JournalTouch> Rig::Touch(const source::TouchCommand& command,
                                                 const source::MotionGuard& caller) {
  const source::MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_RETURN_IF_ERROR(EnsureSession(command.session));
  unwritten_.Flush();
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<session::JournalTouch> known, FindDone(command));
  if (known.has_value()) return *std::move(known);
  auto taken = TakeRig(guard);
  if (!taken.ok()) return Refused(command, taken.status());
  const auto lock = *std::move(taken);
  TOUCHSTONE_ASSIGN_OR_RETURN(known, FindDone(command));  // made while this one waited
  if (known.has_value()) return *std::move(known);

  // Everything that can forbid it, before anything is written or moved.
  const calibration::UpFace up_face = calibration::UpFaceFor(command.touch.approach);
  absl::StatusOr<arm::PlannedTouch> admitted = Admit(command, up_face, guard);
  if (!admitted.ok()) return Refused(command, admitted.status());
  const arm::PlannedTouch plan = *std::move(admitted);

  const double began_s = NowS(), began_unix_s = timing::UnixNowS();
  // Whatever else is written for it goes before: once it is executing, only its end is left to write.
  TOUCHSTONE_ASSIGN_OR_RETURN(const double session_time_s, session_clock_.NowS(command.session));
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint32_t program_id, NextProgramId());
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const session::JournalTouch intent,
      journal().BeginExecuting(command.session, command.id, command.object, calibration::UpFaceName(up_face),
                               command.bytes, program_id, parts_.effector->State().boot_id));
  if (intent.stage == session::TouchStage::kDone) return intent;
  ++motions_;
  std::optional<session::JournalSeries> series;
  absl::StatusOr<session::JournalResult> result = MakeTouch(plan, program_id, command, guard, &series);
  --motions_;
  if (!result.ok()) {
    Remember(result.status());
    spdlog::warn("touch '{}' of session '{}': {}", command.id, command.session,
                 std::string(result.status().message()));
    TOUCHSTONE_RETURN_IF_ERROR(
        unwritten_.Failed(command.session, command.id, std::string(result.status().message())));
    audit()
        .Write("touch_failed", {{"session", command.session},
                                {"id", command.id},
                                {"code", absl::StatusCodeToString(result.status().code())},
                                {"why", std::string(result.status().message())}})
        .IgnoreError();
    return result.status();
  }

  if (result->start_unix_s == 0) result->start_unix_s = began_unix_s;
  result->session_time_s = session_time_s;
  TOUCHSTONE_RETURN_IF_ERROR(
      unwritten_.Done(command.session, command.id, *result, series.has_value() ? &*series : nullptr));
  {
    std::lock_guard<std::mutex> status_lock(status_mutex_);
    const double took_s = NowS() - began_s;
    status_.touch_duration_s = status_.touches == 0 ? took_s : 0.9 * status_.touch_duration_s + 0.1 * took_s;
    ++status_.touches;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(known, FindDone(command));
  if (!known.has_value()) return absl::InternalError("the journal lost a result that it had acknowledged");
  return *std::move(known);
}

image::Intrinsics Rig::IntrinsicsOf(const image::Frame& frame) const {
  if (parts_.intrinsics.has_value()) return *parts_.intrinsics;
  return image::PinholeIntrinsics(frame.width, frame.height, parts_.vertical_fov_rad);
}

absl::StatusOr<Rig::DryRun> Rig::BeginDryRun() const {
  DryRun run;
  TOUCHSTONE_ASSIGN_OR_RETURN(run.at, parts_.arm->State());
  run.object = Status().object, run.up_face = MountedUpFace();
  return run;
}

absl::Status Rig::MountInDryRun(const std::string& object, calibration::UpFace up_face, DryRun* run) const {
  if (run->object == object && run->up_face == up_face) return absl::OkStatus();
  run->object = object, run->up_face = up_face;
  if (options_.mount_command.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::UrKinematics kinematics, parts_.planner->Kinematics());
  run->at.joints_rad = parts_.planner->limits().home_rad;
  run->at.base_from_tip =
      kinematics.Forward(run->at.joints_rad) * parts_.planner->calibration().flange_from_tip;
  return absl::OkStatus();
}

absl::StatusOr<arm::PlannedTouch> Rig::Check(const std::string& object, const geometry::Bounds& bounds,
                                             const touch::CommandedTouch& touch, const arm::ArmState* from,
                                             const std::string& where) const {
  arm::ArmState here;
  if (from != nullptr) {
    here = *from;
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(here, parts_.arm->State());
  }
  return parts_.planner->Plan(here, object, bounds, calibration::UpFaceFor(touch.approach), touch, where);
}

absl::StatusOr<arm::PlannedTouch> Rig::CheckView(const source::ViewCommand& command,
                                                 const arm::ArmState* from, const std::string& where) const {
  arm::ArmState here;
  if (from != nullptr) {
    here = *from;
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(here, parts_.arm->State());
  }
  const calibration::UpFace up_face = calibration::UpFaceFor(command.object_from_camera.rotation().col(2));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Isometry3d base_from_object,
                              parts_.planner->ObjectPose(command.object, command.bounds, up_face));
  return parts_.planner->PlanView(here, base_from_object * command.object_from_camera, command.object,
                                  command.bounds, up_face, where);
}

}  // namespace touchstone::gateway
