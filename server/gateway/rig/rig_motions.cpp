// Motions that are no touches: powering on, home, changing the object, photographs.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/rig.h"
#include "server/gateway/rig/watches/run_command.h"
#include "server/geometry/pose.h"
#include "server/image/encoding/encode.h"

namespace touchstone::gateway {
namespace {

std::array<double, 3> ArrayOf(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

// Without the time.
session::JournalView ViewOf(const source::ViewCommand& command, const Eigen::Isometry3d& base_from_object,
                            const image::Intrinsics& lens, const image::Frame& frame) {
  session::JournalView view;
  const Eigen::Isometry3d& camera = command.object_from_camera;
  const image::Camera commanded = command.commanded.value_or(image::Camera{
      camera.translation(), camera.translation() + camera.linear().col(2), -camera.linear().col(1)});
  view.eye_m = ArrayOf(commanded.eye_m), view.at_m = ArrayOf(commanded.at_m), view.up = ArrayOf(commanded.up);
  view.base_from_object = geometry::PoseVectorOf(base_from_object);
  const image::Intrinsics scaled = image::ScaledTo(lens, frame.width, frame.height);
  view.fx_px = scaled.fx_px, view.fy_px = scaled.fy_px, view.cx_px = scaled.cx_px, view.cy_px = scaled.cy_px;
  view.distortion = scaled.distortion;
  return view;
}

}  // namespace

absl::Status Rig::ReadyToMove(const source::MotionGuard& guard) {
  constexpr double kProgramEndsS = 1;  // host time; the one before is at its last cycles
  LookAtSafety(/*asked=*/true);
  TOUCHSTONE_RETURN_IF_ERROR(guard());
  TOUCHSTONE_RETURN_IF_ERROR(parts_.arm->Ready());
  for (const double until_s = NowS() + kProgramEndsS;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState state, parts_.arm->State());
    if (state.runtime_state == arm::RuntimeState::kStopped) return absl::OkStatus();
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    if (NowS() >= until_s)
      return absl::FailedPreconditionError(
          absl::StrCat("a program that is not this gateway's ",
                       state.runtime_state == arm::RuntimeState::kPaused ? "is paused" : "runs",
                       " on the controller: end it at the teach pendant first"));
    parts_.changes->WaitForChange(parts_.changes->count(), 0.01);
  }
}

absl::Status Rig::PowerUp(const source::MotionGuard& guard) {
  constexpr double kPatienceS = 10, kPowerOffShowsS = 2;  // host time
  LookAtSafety(/*asked=*/true);
  TOUCHSTONE_RETURN_IF_ERROR(guard());
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState state, parts_.arm->State());
  if (state.robot_mode == arm::RobotMode::kRunning || !arm::SafetyPermitsMotion(state.safety_mode).ok())
    return parts_.arm->Ready();
  audit().Write("power_on", {{"robot_mode", arm::RobotModeName(state.robot_mode)}}).IgnoreError();
  // An arm that is told to release its brakes does so by itself, whatever becomes of this process.
  TOUCHSTONE_RETURN_IF_ERROR(unwritten_.SetFacts({{kMotionKey, "0 powering the arm on"}}, false));
  powering_ = true;
  absl::Status status = parts_.arm->PowerOn(guard);
  // The states report it a little later than the dashboard.
  for (const double until_s = NowS() + kPatienceS;
       status.ok() && !parts_.arm->Ready().ok() && NowS() < until_s;) {
    status = guard();
    parts_.changes->WaitForChange(parts_.changes->count(), 0.01);
  }
  if (status.ok()) status = parts_.arm->Ready();
  if (status.ok()) zeroed_n_.setZero();
  if (!status.ok()) {
    if (!parts_.arm->State().ok()) LatchLoss(absl::StrCat("while it was powered on: ", status.message()));
    // What was taken back is not taken for somebody else's doing.
    const auto off = [this] {
      const absl::StatusOr<arm::ArmState> now = parts_.arm->State();
      return !now.ok() || now->robot_mode != arm::RobotMode::kRunning;
    };
    for (const double until_s = NowS() + kPowerOffShowsS; !off() && NowS() < until_s;)
      parts_.changes->WaitForChange(parts_.changes->count(), 0.01);
  }
  LookAtSafety();
  powering_ = false;
  unwritten_.SetFacts({{kMotionKey, ""}}, true).IgnoreError();
  return status;
}

absl::Status Rig::PowerOn(const source::MotionGuard& caller) {
  const source::MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  const absl::Status status = PowerUp(guard);
  if (!status.ok()) Remember(status);
  return status;
}

absl::StatusOr<source::Photograph> Rig::Photograph(const source::ViewCommand& command,
                                                   const source::MotionGuard& caller) {
  const source::MotionGuard guard = UntilStopped(caller);
  if (parts_.camera == nullptr)
    return absl::FailedPreconditionError(
        "this rig has no camera: set camera.uri in the gateway's configuration");
  if (!parts_.planner->calibration().has_camera)
    return absl::FailedPreconditionError(
        "the calibration file has no flange_from_camera: where the camera sits");
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  TOUCHSTONE_RETURN_IF_ERROR(ReadyToMove(guard));
  const calibration::UpFace up_face = calibration::UpFaceFor(command.object_from_camera.rotation().col(2));
  TOUCHSTONE_RETURN_IF_ERROR(EnsureMounted(command.object, up_face, guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Isometry3d base_from_object,
                              parts_.planner->ObjectPose(command.object, command.bounds, up_face));
  const Eigen::Isometry3d base_from_camera = base_from_object * command.object_from_camera;
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState from, parts_.arm->State());
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const arm::PlannedTouch plan,
      parts_.planner->PlanView(from, base_from_camera, command.object, command.bounds, up_face, "view"));
  // Whatever the session's beginning writes goes before the motion, as with a touch.
  TOUCHSTONE_RETURN_IF_ERROR(EnsureSession(command.session));
  const double began_s = NowS();
  TOUCHSTONE_ASSIGN_OR_RETURN(const double session_time_s, session_clock_.NowS(command.session));
  TOUCHSTONE_RETURN_IF_ERROR(MoveThrough(plan.motion.transit, {}, plan.motion.duration_s, guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState arrived, parts_.arm->State());
  const absl::StatusOr<image::Frame> frame = parts_.camera->Take(NowS());
  if (!frame.ok()) {
    Remember(frame.status());
    return frame.status();
  }
  // Every state from the asking to now: the exposure lies somewhere within. By the controller's time, since states that
  // are read together have one host time, which the asking may have too: the clock of an emulated rig stands now and then.
  const Eigen::Isometry3d tip_from_camera = plan.motion.transit.back().inverse() * base_from_camera;
  const absl::StatusOr<MeasuredCameraPose> measured = MeasureCameraPose(
      StatesAfter(arrived.controller_time_s), tip_from_camera, base_from_camera, options_.camera_tolerance);
  if (!measured.ok()) {
    Remember(measured.status());
    return measured.status();
  }
  session::JournalImage image;
  image.id = source::ViewId(command);
  image.object = command.object, image.up_face = calibration::UpFaceName(up_face);
  image.base_from_camera = geometry::PoseVectorOf(base_from_camera);
  image.unix_s = timing::UnixNowS() - (NowS() - frame->host_time_s);
  image.measured_base_from_camera = geometry::PoseVectorOf(measured->base_from_camera);
  image.measured_unix_s = image.unix_s;
  image.width = frame->width, image.height = frame->height;
  TOUCHSTONE_ASSIGN_OR_RETURN(image.png, image::EncodePng(frame->rgb.data(), frame->width, frame->height, 3));
  image.view = ViewOf(command, base_from_object, IntrinsicsOf(*frame), *frame);
  image.view->session_time_s = session_time_s + (frame->host_time_s - began_s) * options_.time_scale;
  // A view that was taken before is a repeat, under a name of its own.
  absl::Status added = journal().AddImage(command.session, image);
  for (int repeat = 2; absl::IsAlreadyExists(added); ++repeat) {
    image.id = absl::StrCat(source::ViewId(command), " #", repeat);
    added = journal().AddImage(command.session, image);
  }
  TOUCHSTONE_RETURN_IF_ERROR(added);
  std::lock_guard<std::mutex> status_lock(status_mutex_);
  ++status_.images;
  status_.image_width = frame->width, status_.image_height = frame->height;
  source::Photograph photograph;
  photograph.frame = *frame;
  photograph.object_from_camera = base_from_object.inverse() * measured->base_from_camera;
  photograph.unix_s = image.unix_s;
  photograph.deviation_m = measured->deviation_m, photograph.deviation_rad = measured->deviation_rad;
  return photograph;
}

std::vector<arm::ArmState> Rig::StatesAfter(double controller_s) const {
  constexpr double kNextStateS = 0.5;  // host time
  const double called_s = NowS();
  uint64_t changes = parts_.changes->count();
  absl::StatusOr<arm::ArmState> now = parts_.arm->State();
  const auto is_next = [&] { return now->host_time_s >= called_s && now->controller_time_s > controller_s; };
  while (now.ok() && !is_next() && NowS() < called_s + kNextStateS) {
    parts_.changes->WaitForChange(changes, 0.01);
    changes = parts_.changes->count();
    now = parts_.arm->State();
  }
  if (!now.ok()) return {};
  return parts_.arm->History(std::nextafter(controller_s, std::numeric_limits<double>::infinity()),
                             now->controller_time_s);
}

absl::Status Rig::MoveThrough(const std::vector<Eigen::Isometry3d>& poses,
                              const std::vector<std::array<double, 6>>& joints, double duration_s,
                              const source::MotionGuard& guard) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint32_t program_id, NextProgramId());
  TOUCHSTONE_RETURN_IF_ERROR(
      unwritten_.SetFacts({{kMotionKey, absl::StrCat(program_id, " a motion without a touch")}}, false));
  ++motions_;
  const HeartbeatScope beating(heartbeats_.get());
  Program program{program_id, guard, parts_.planner->limits().max_force_n};
  absl::Status status = Launch(&program, "a motion", [&](const arm::StartGuard& start) {
    return parts_.arm->MoveThrough(program_id, poses, joints, start);
  });
  if (status.ok())
    status = Supervise(&program, 2 * duration_s / options_.time_scale + 15, "a motion",
                       [](const arm::ArmState& state) -> absl::StatusOr<bool> {
                         return state.phase == arm::MotionPhase::kDone;
                       });
  --motions_;
  if (!status.ok()) {
    Remember(status);
    // This process knows how it ended: no riddle for the next one.
    unwritten_.SetFacts({{kMotionKey, ""}}, true).IgnoreError();
  }
  return status;
}

absl::Status Rig::Home(const source::MotionGuard& caller) {
  const source::MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  return MoveHome(guard);
}

absl::Status Rig::MoveHome(const source::MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(ReadyToMove(guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState from, parts_.arm->State());
  // How high the tool must be lifted depends on what lies there.
  std::optional<double> top_m;
  const std::string object = Status().object;
  const std::optional<calibration::UpFace> up_face = MountedUpFace();
  const auto bounds = options_.bounds_of && up_face.has_value() ? options_.bounds_of(object) : std::nullopt;
  if (bounds.has_value()) {
    const absl::StatusOr<double> top = parts_.planner->ObjectTop(object, *bounds, *up_face);
    if (top.ok()) top_m = *top;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::HomePath path, parts_.planner->PlanHome(from, top_m));
  return MoveThrough(path.poses, path.joints, 30, guard);
}

absl::StatusOr<bool> Rig::AtHome() const {
  constexpr double kTolerance = 1e-3;  // rad of a joint: half a millimetre at the tip
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState state, parts_.arm->State());
  const std::array<double, 6>& home_rad = parts_.planner->limits().home_rad;
  return std::equal(home_rad.begin(), home_rad.end(), state.joints_rad.begin(),
                    [](double home, double joint) { return std::abs(joint - home) < kTolerance; });
}

absl::Status Rig::EnsureMounted(const std::string& object, calibration::UpFace up_face,
                                const source::MotionGuard& guard) {
  const source::SourceStatus now = Status();
  const std::optional<calibration::UpFace> mounted_face = MountedUpFace();
  if (now.object == object && mounted_face == up_face) return absl::OkStatus();
  // The tool leaves before anything is moved there, by whomever. A person who is told what to do finds it gone.
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool at_home, AtHome());
  if (!at_home || !options_.mount_command.empty()) TOUCHSTONE_RETURN_IF_ERROR(MoveHome(guard));
  const std::string face = calibration::UpFaceName(up_face);
  if (options_.mount_command.empty())
    return absl::FailedPreconditionError(absl::StrCat(
        now.object.empty() ? "what lies on the fixture is unknown"
                           : absl::StrCat("'", now.object, "' lies on the fixture",
                                          mounted_face.has_value()
                                              ? absl::StrCat(" with its face ",
                                                             calibration::UpFaceName(*mounted_face), " up")
                                              : ""),
        ": put '", object, "' there with its face ", face, " up, then: touchstone rig mount ", object, " ",
        face));
  std::vector<std::string> command = options_.mount_command;
  for (std::string& word : command)
    word = absl::StrReplaceAll(word, {{"{object}", object}, {"{up_face}", face}, {"{placement}", face}});
  TOUCHSTONE_RETURN_IF_ERROR(NoteNothingMounted());
  TOUCHSTONE_RETURN_IF_ERROR(RunCommand(command, options_.mount_timeout_s, guard));
  return NoteMounted(object, up_face);
}

absl::Status Rig::NoteNothingMounted() {
  {
    std::lock_guard<std::mutex> lock(status_mutex_);
    status_.object.clear(), up_face_.reset();
  }
  return unwritten_.SetFacts({{"mounted_object", ""}, {"mounted_placement", ""}}, true);
}

absl::Status Rig::NoteMounted(const std::string& object, calibration::UpFace up_face) {
  // What lay there before does not any more, whether or not this can be written down.
  const absl::Status noted = unwritten_.SetFacts(
      {{"mounted_object", object}, {"mounted_placement", calibration::UpFaceName(up_face)}}, false);
  if (!noted.ok()) {
    NoteNothingMounted().IgnoreError();
    return noted;
  }
  audit().Write("mounted", {{"object", object}, {"up_face", calibration::UpFaceName(up_face)}}).IgnoreError();
  std::lock_guard<std::mutex> lock(status_mutex_);
  status_.object = object, up_face_ = up_face;
  return absl::OkStatus();
}

absl::Status Rig::Mount(const std::string& object, calibration::UpFace up_face,
                        const source::MotionGuard& caller) {
  const source::MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  if (!options_.mount_command.empty()) return EnsureMounted(object, up_face, guard);
  return NoteMounted(object, up_face);
}

}  // namespace touchstone::gateway
