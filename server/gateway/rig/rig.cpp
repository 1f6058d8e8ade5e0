#include "server/gateway/rig/rig.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/run_command.h"
#include "server/geometry/pose.h"
#include "server/image/encode.h"
#include "server/session/command_bytes.h"

namespace touchstone {
namespace {

double UnixNowS() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// Program ids are taken from the journal in blocks, so that no id is ever used twice, whatever happens.
constexpr uint32_t kProgramIdBlock = 1000;
constexpr char kStopFact[] = "stop";  // who stopped the rig and why; "" once it was reset
constexpr uint32_t kMaxProgramId = (1u << 28) - kProgramIdBlock;

}  // namespace

absl::StatusOr<std::unique_ptr<Rig>> Rig::Create(RigOptions options, RigParts parts) {
  std::unique_ptr<Rig> rig(new Rig(std::move(options), std::move(parts)));
  Journal& journal = rig->journal();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string next, journal.Fact("next_program_id"));
  if (!next.empty() && !absl::SimpleAtoi(next, &rig->next_program_id_))
    return absl::DataLossError(
        absl::StrCat("the journal's next_program_id is '", next, "': a number was expected"));
  rig->reserved_program_id_ = rig->next_program_id_;
  TOUCHSTONE_ASSIGN_OR_RETURN(rig->status_.object, journal.Fact("mounted_object"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string up_face, journal.Fact("mounted_placement"));
  if (!up_face.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(rig->up_face_, ParseUpFace(up_face, "the journal's mounted_placement"));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(rig->stop_reason_, journal.Fact(kStopFact));
  rig->stopped_ = !rig->stop_reason_.empty();
  if (rig->stopped_) spdlog::warn("still stopped {}; touchstone rig reset releases it", rig->stop_reason_);
  TOUCHSTONE_RETURN_IF_ERROR(rig->Reconcile());
  return rig;
}

Rig::~Rig() {
  if (motions_ > 0) parts_.arm->Stop().IgnoreError();
}

uint32_t Rig::NextProgramId() {
  if (next_program_id_ >= kMaxProgramId) next_program_id_ = reserved_program_id_ = 1;
  if (next_program_id_ >= reserved_program_id_) {
    reserved_program_id_ = next_program_id_ + kProgramIdBlock;
    const absl::Status kept = journal().SetFact("next_program_id", absl::StrCat(reserved_program_id_));
    if (!kept.ok()) spdlog::error("journal: {}", std::string(kept.message()));
  }
  return next_program_id_++;
}

MotionGuard Rig::UntilStopped(const MotionGuard& caller) const {
  return [this, caller, stops = stops_.load()]() -> absl::Status {
    if (stops_ == stops && !stopped_) return caller();
    const std::string reason = StopReason();
    return absl::AbortedError(absl::StrCat("the rig was stopped", reason.empty() ? "" : " ", reason,
                                           ": make sure that it may move, then release the stop with "
                                           "'touchstone rig reset'"));
  };
}

absl::StatusOr<std::unique_lock<std::timed_mutex>> Rig::TakeRig(const MotionGuard& guard) {
  for (;;) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    std::unique_lock<std::timed_mutex> lock(moving_, std::chrono::milliseconds(10));
    if (lock.owns_lock()) return lock;
  }
}

std::optional<UpFace> Rig::MountedUpFace() const {
  std::lock_guard<std::mutex> lock(status_mutex_);
  return up_face_;
}

void Rig::Remember(const absl::Status& status) {
  std::lock_guard<std::mutex> lock(status_mutex_);
  status_.last_error = std::string(status.message());
}

SourceStatus Rig::Status() const {
  SourceStatus status;
  {
    std::lock_guard<std::mutex> lock(status_mutex_);
    status = status_;
  }
  const ClockEstimate clock = parts_.effector->Clock();
  if (clock.valid) status.clock_uncertainty_s = clock.offset_uncertainty_s / clock.rate * options_.time_scale;
  return status;
}

absl::Status Rig::PowerUp(const MotionGuard& guard) {
  constexpr double kPatienceS = 10;
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState state, parts_.arm->State());
  if (state.robot_mode == RobotMode::kRunning || !SafetyPermitsMotion(state.safety_mode).ok())
    return parts_.arm->Ready();
  audit().Write("power_on", {{"robot_mode", RobotModeName(state.robot_mode)}}).IgnoreError();
  TOUCHSTONE_RETURN_IF_ERROR(parts_.arm->PowerOn(guard));
  // The states report it a little later than the dashboard.
  for (const double until_s = HostNowS() + kPatienceS; !parts_.arm->Ready().ok() && HostNowS() < until_s;) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    parts_.changes->WaitForChange(parts_.changes->count(), 0.01);
  }
  return parts_.arm->Ready();
}

absl::Status Rig::EnsureSession(const std::string& name) {
  std::lock_guard<std::mutex> lock(sessions_mutex_);
  if (sessions_.count(name) > 0) return absl::OkStatus();
  JournalSession session;
  session.name = name;
  session.created_unix_s = UnixNowS();
  session.source = Provenance();
  session.calibration = FormatCalibration(parts_.planner->calibration());
  session.fingers = options_.fingers;
  session.spacing_m = options_.spacing_m;
  TOUCHSTONE_RETURN_IF_ERROR(journal().EnsureSession(session));
  sessions_.insert(name);
  return absl::OkStatus();
}

std::string Rig::Provenance() const {
  const EffectorState effector = parts_.effector->State();
  return absl::StrCat(options_.provenance_note, options_.provenance_note.empty() ? "" : "; ",
                      parts_.arm->Model(), " at ", parts_.arm->Address(), ", end effector ",
                      effector.firmware, " at ", options_.effector_port);
}

absl::StatusOr<std::optional<JournalTouch>> Rig::FindDone(const TouchCommand& command) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<JournalTouch> touch,
                              parts_.journal->Find(command.session, command.id));
  if (!touch.has_value()) return touch;
  if (touch->object != command.object || !SameCommand(touch->command, command.bytes))
    return absl::AlreadyExistsError(absl::StrCat("touch id '", command.id, "' of session '", command.session,
                                                 "' stands for another touch already: take a new id"));
  if (touch->stage != TouchStage::kDone) return std::optional<JournalTouch>();
  return touch;
}

absl::StatusOr<JournalTouch> Rig::Touch(const TouchCommand& command, const MotionGuard& caller) {
  const MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_RETURN_IF_ERROR(EnsureSession(command.session));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<JournalTouch> known, FindDone(command));
  if (known.has_value()) return *std::move(known);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(known, FindDone(command));  // made while this one waited
  if (known.has_value()) return *std::move(known);

  // Everything that can forbid it, before anything is written or moved.
  TOUCHSTONE_RETURN_IF_ERROR(PowerUp(guard));
  if (const EffectorState effector = parts_.effector->State(); !effector.connected)
    return absl::UnavailableError(absl::StrCat("the end effector is not there: ", effector.why));
  const UpFace up_face = UpFaceFor(command.touch.approach);
  TOUCHSTONE_RETURN_IF_ERROR(EnsureMounted(command.object, up_face, guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState from, parts_.arm->State());
  TOUCHSTONE_ASSIGN_OR_RETURN(
      PlannedTouch plan, parts_.planner->Plan(from, command.object, command.bounds, up_face, command.touch,
                                              "touch '" + command.id + "'"));

  const double began_s = HostNowS(), began_unix_s = UnixNowS();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const JournalTouch intent,
      journal().Begin(command.session, command.id, command.object, UpFaceName(up_face), command.bytes));
  if (intent.stage == TouchStage::kDone) return intent;
  const uint32_t program_id = NextProgramId();
  TOUCHSTONE_RETURN_IF_ERROR(
      journal().Executing(command.session, command.id, program_id, parts_.effector->State().boot_id));
  ++motions_;
  absl::StatusOr<JournalResult> result = MakeTouch(plan, program_id, command, guard);
  --motions_;
  if (!result.ok()) {
    Remember(result.status());
    spdlog::warn("touch '{}' of session '{}': {}", command.id, command.session,
                 std::string(result.status().message()));
    TOUCHSTONE_RETURN_IF_ERROR(
        journal().Failed(command.session, command.id, std::string(result.status().message())));
    audit()
        .Write("touch_failed", {{"session", command.session},
                                {"id", command.id},
                                {"why", std::string(result.status().message())}})
        .IgnoreError();
    return result.status();
  }

  result->start_unix_s = began_unix_s;
  TOUCHSTONE_ASSIGN_OR_RETURN(result->session_time_s, SessionTimeS(command.session, began_unix_s));
  TOUCHSTONE_RETURN_IF_ERROR(journal().Done(command.session, command.id, *result));
  {
    std::lock_guard<std::mutex> status_lock(status_mutex_);
    const double took_s = HostNowS() - began_s;
    status_.touch_duration_s = status_.touches == 0 ? took_s : 0.9 * status_.touch_duration_s + 0.1 * took_s;
    ++status_.touches;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(known, FindDone(command));
  if (!known.has_value()) return absl::InternalError("the journal lost a result that it had acknowledged");
  return *std::move(known);
}

absl::StatusOr<double> Rig::SessionTimeS(const std::string& session, double unix_s) {
  const std::string key = "first_touch_unix_s " + session;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, journal().Fact(key));
  double first_s = unix_s;
  if (text.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(journal().SetFact(key, absl::StrFormat("%.6f", unix_s)));
  } else if (!absl::SimpleAtod(text, &first_s)) {
    return absl::DataLossError(
        absl::StrCat("the journal's '", key, "' is '", text, "': a number was expected"));
  }
  return (unix_s - first_s) * options_.time_scale;
}

absl::StatusOr<Frame> Rig::Photograph(const ViewCommand& command, const MotionGuard& caller) {
  const MotionGuard guard = UntilStopped(caller);
  if (parts_.camera == nullptr)
    return absl::FailedPreconditionError(
        "this rig has no camera: set camera.source in the gateway's configuration");
  if (!parts_.planner->calibration().has_camera)
    return absl::FailedPreconditionError(
        "the calibration file has no flange_from_camera: where the camera sits");
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  TOUCHSTONE_RETURN_IF_ERROR(PowerUp(guard));
  const UpFace up_face = UpFaceFor(command.object_from_camera.rotation().col(2));
  TOUCHSTONE_RETURN_IF_ERROR(EnsureMounted(command.object, up_face, guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Isometry3d base_from_object,
                              parts_.planner->ObjectPose(command.object, command.bounds, up_face));
  const Eigen::Isometry3d base_from_camera = base_from_object * command.object_from_camera;
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState from, parts_.arm->State());
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const PlannedTouch plan,
      parts_.planner->PlanView(from, base_from_camera, command.object, command.bounds, up_face, "view"));
  TOUCHSTONE_RETURN_IF_ERROR(MoveThrough(plan.motion.transit, {}, plan.motion.duration_s, guard));
  const absl::StatusOr<Frame> frame = parts_.camera->Take(HostNowS());
  if (!frame.ok()) {
    Remember(frame.status());
    return frame;
  }
  TOUCHSTONE_RETURN_IF_ERROR(EnsureSession(command.session));
  JournalImage image;
  image.id = ViewId(command);
  image.object = command.object, image.placement = UpFaceName(up_face);
  image.base_from_camera = PoseVectorOf(base_from_camera);
  image.unix_s = UnixNowS();
  image.width = frame->width, image.height = frame->height;
  TOUCHSTONE_ASSIGN_OR_RETURN(image.png, EncodePng(frame->rgb.data(), frame->width, frame->height, 3));
  TOUCHSTONE_RETURN_IF_ERROR(journal().AddImage(command.session, image));
  std::lock_guard<std::mutex> status_lock(status_mutex_);
  ++status_.images;
  status_.image_width = frame->width, status_.image_height = frame->height;
  return frame;
}

Intrinsics Rig::IntrinsicsOf(const Frame& frame) const {
  if (parts_.intrinsics.has_value()) return *parts_.intrinsics;
  return PinholeIntrinsics(frame.width, frame.height, parts_.vertical_fov_rad);
}

absl::Status Rig::MoveThrough(const std::vector<Eigen::Isometry3d>& poses,
                              const std::vector<std::array<double, 6>>& joints, double duration_s,
                              const MotionGuard& guard) {
  const uint32_t program_id = NextProgramId();
  ++motions_;
  absl::Status status = parts_.arm->MoveThrough(program_id, poses, joints);
  if (status.ok())
    status = Supervise(
        program_id, 2 * duration_s / options_.time_scale + 15, "a motion", guard,
        [](const ArmState& state) -> absl::StatusOr<bool> { return state.phase == MotionPhase::kDone; });
  --motions_;
  if (!status.ok()) Remember(status);
  return status;
}

absl::Status Rig::Home(const MotionGuard& caller) {
  const MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  return MoveHome(guard);
}

absl::Status Rig::MoveHome(const MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(PowerUp(guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState from, parts_.arm->State());
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Eigen::Isometry3d> poses, parts_.planner->PlanHome(from));
  return MoveThrough(poses, {parts_.planner->limits().home_rad}, 30, guard);
}

absl::Status Rig::EnsureMounted(const std::string& object, UpFace up_face, const MotionGuard& guard) {
  const SourceStatus now = Status();
  const std::optional<UpFace> mounted_face = MountedUpFace();
  if (now.object == object && mounted_face == up_face) return absl::OkStatus();
  const std::string face = UpFaceName(up_face);
  if (options_.mount_command.empty())
    return absl::FailedPreconditionError(absl::StrCat(
        now.object.empty()
            ? "what lies on the fixture is unknown"
            : absl::StrCat("'", now.object, "' lies on the fixture",
                           mounted_face.has_value()
                               ? absl::StrCat(" with its face ", UpFaceName(*mounted_face), " up")
                               : ""),
        ": put '", object, "' there with its face ", face, " up, then: touchstone rig mount ", object, " ",
        face));
  // The tool leaves before anything is moved there.
  TOUCHSTONE_RETURN_IF_ERROR(MoveHome(guard));
  std::vector<std::string> command = options_.mount_command;
  for (std::string& word : command)
    word = absl::StrReplaceAll(word, {{"{object}", object}, {"{up_face}", face}, {"{placement}", face}});
  TOUCHSTONE_RETURN_IF_ERROR(RunCommand(command, options_.mount_timeout_s, guard));
  return NoteMounted(object, up_face);
}

absl::Status Rig::NoteMounted(const std::string& object, UpFace up_face) {
  TOUCHSTONE_RETURN_IF_ERROR(journal().SetFact("mounted_object", object));
  TOUCHSTONE_RETURN_IF_ERROR(journal().SetFact("mounted_placement", UpFaceName(up_face)));
  audit().Write("mounted", {{"object", object}, {"up_face", UpFaceName(up_face)}}).IgnoreError();
  std::lock_guard<std::mutex> lock(status_mutex_);
  status_.object = object, up_face_ = up_face;
  return absl::OkStatus();
}

absl::Status Rig::Mount(const std::string& object, UpFace up_face, const MotionGuard& caller) {
  const MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  if (!options_.mount_command.empty()) return EnsureMounted(object, up_face, guard);
  return NoteMounted(object, up_face);
}

absl::Status Rig::PowerOn(const MotionGuard& caller) {
  const MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  const absl::Status status = PowerUp(guard);
  if (!status.ok()) Remember(status);
  return status;
}

absl::StatusOr<PlannedTouch> Rig::Check(const std::string& object, const Bounds& bounds,
                                        const CommandedTouch& touch, const ArmState* from,
                                        const std::string& where) const {
  ArmState here;
  if (from != nullptr) {
    here = *from;
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(here, parts_.arm->State());
  }
  return parts_.planner->Plan(here, object, bounds, UpFaceFor(touch.approach), touch, where);
}

uint32_t Rig::Stop(const std::string& reason, const std::string& who) {
  const uint32_t motions = motions_;
  stopped_ = true;
  ++stops_;
  const absl::Status status = parts_.arm->Stop();
  parts_.changes->Notify();
  if (!status.ok()) spdlog::error("stop: {}", std::string(status.message()));
  {
    std::lock_guard<std::mutex> lock(stop_mutex_);
    // A reset that was under way may have released it since.
    stopped_ = true;
    stop_reason_ = absl::StrCat("by ", who, " (", reason, ")");
    const absl::Status kept = journal().SetFact(kStopFact, stop_reason_);
    if (!kept.ok()) spdlog::error("journal: {}", std::string(kept.message()));
  }
  audit()
      .Write("stop", {{"who", who},
                      {"reason", reason},
                      {"motions", absl::StrCat(motions)},
                      {"sent", status.ok() ? "yes" : std::string(status.message())}})
      .IgnoreError();
  return motions;
}

absl::Status Rig::Reset(const std::string& reason, const std::string& who) {
  const uint64_t stops = stops_;
  if (!stopped_) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState arm, parts_.arm->State());
  if (const absl::Status safety = SafetyPermitsMotion(arm.safety_mode); !safety.ok())
    return absl::FailedPreconditionError(
        absl::StrCat("the stop holds: ", safety.message(), "; then reset again"));
  {
    std::lock_guard<std::mutex> lock(stop_mutex_);
    if (stops_ != stops) return absl::AbortedError("the rig was stopped again meanwhile: the stop holds");
    // On the disk before anything may move.
    TOUCHSTONE_RETURN_IF_ERROR(journal().SetFact(kStopFact, ""));
    stop_reason_.clear();
    stopped_ = false;
  }
  audit().Write("reset", {{"who", who}, {"reason", reason}}).IgnoreError();
  return absl::OkStatus();
}

std::string Rig::StopReason() const {
  std::lock_guard<std::mutex> lock(stop_mutex_);
  return stop_reason_;
}

SourceState Rig::State() const {
  const absl::StatusOr<ArmState> arm = parts_.arm->State();
  if (!arm.ok()) return SourceState::kDisconnected;
  switch (arm->safety_mode) {
    case SafetyMode::kNormal:
    case SafetyMode::kReduced:
      break;
    case SafetyMode::kProtectiveStop:
      return SourceState::kProtectiveStop;
    case SafetyMode::kRecovery:
      return SourceState::kRecovery;
    case SafetyMode::kSafeguardStop:
      return SourceState::kSafeguardStop;
    case SafetyMode::kSystemEmergencyStop:
    case SafetyMode::kRobotEmergencyStop:
      return SourceState::kEmergencyStop;
    default:
      return SourceState::kFault;
  }
  if (stopped_) return SourceState::kStopped;
  if (arm->robot_mode != RobotMode::kRunning) return SourceState::kPoweredOff;
  if (!parts_.effector->State().connected) return SourceState::kDisconnected;
  return motions_ > 0 ? SourceState::kBusy : SourceState::kIdle;
}

}  // namespace touchstone
