#include "server/service/gateway/rig_service.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"
#include "server/geometry/pose.h"
#include "server/service/calls/call_guard.h"
#include "server/service/connections/relayed_peer.h"
#include "server/service/core/convert.h"
#include "server/session/recorded/base_pose.h"
#include "server/source/request_checks.h"

namespace touchstone::service {
namespace {

constexpr size_t kMaxStopReasonBytes = 500;  // several are joined

v1::BasePose PoseToProto(const Eigen::Isometry3d& pose) {
  return session::BasePoseMessage(geometry::PoseVectorOf(pose));
}

v1::RigLimits LimitsOf(const gateway::arm::MotionLimits& limits) {
  v1::RigLimits message;
  *message.mutable_box_min_m() = ToProto(limits.box_min_m);
  *message.mutable_box_max_m() = ToProto(limits.box_max_m);
  *message.mutable_arm_box_min_m() = ToProto(limits.ArmBoxMin());
  *message.mutable_arm_box_max_m() = ToProto(limits.arm_box_max_m);
  message.set_arm_margin_m(limits.arm_margin_m);
  message.set_min_speed_m_s(limits.min_speed_m_s);
  message.set_max_speed_m_s(limits.max_speed_m_s);
  message.set_max_arm_speed_m_s(limits.max_arm_speed_m_s);
  message.set_max_force_n(limits.max_force_n);
  return message;
}

// Where the arm and its tips are, for a drawing.
absl::Status DescribePosture(const gateway::Rig& rig, const Eigen::Isometry3d& base_from_tip,
                             const std::array<double, 6>& joints_rad, v1::ArmPosture* posture) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const gateway::arm::BodyPoints points, rig.planner().Body(joints_rad));
  for (const Eigen::Vector3d& point : points.links) *posture->add_links_m() = ToProto(point);
  if (points.camera.has_value()) *posture->mutable_camera_m() = ToProto(*points.camera);
  for (int k = 0; k < rig.fingers(); ++k)
    *posture->add_tips_m() =
        ToProto(base_from_tip * Eigen::Vector3d((k - 0.5 * (rig.fingers() - 1)) * rig.spacing_m(), 0, 0));
  return absl::OkStatus();
}

v1::ArmStatus ArmStatusOf(const gateway::arm::Arm& arm, double time_scale) {
  v1::ArmStatus status;
  status.set_model(arm.Model());
  status.set_address(arm.Address());
  status.set_version(arm.Version());
  status.set_rate_hz(arm.StateRateHz());
  const absl::StatusOr<gateway::arm::ArmState> now = arm.State();
  status.set_connected(now.ok());
  if (now.ok()) {
    status.set_robot_mode(static_cast<v1::RobotMode>(now->robot_mode));
    status.set_safety_mode(static_cast<v1::SafetyMode>(now->safety_mode));
    status.set_state_age_s(gateway::timing::HostNowS() - now->host_time_s);
    *status.mutable_base_from_tip() = PoseToProto(now->base_from_tip);
    for (const double q : now->joints_rad) status.add_joints_rad(q);
    status.set_program_id(now->program_id);
    status.set_phase(static_cast<v1::MotionPhase>(now->phase));
    status.set_speed_scaling(now->speed_scaling);
    *status.mutable_tip_force_n() = ToProto(now->tip_force_n);
  }
  if (const gateway::timing::ClockEstimate clock = arm.ControllerClock(); clock.valid) {
    status.set_clock_drift(clock.rate / time_scale - 1);
    status.set_clock_uncertainty_s(clock.offset_uncertainty_s);
  }
  return status;
}

v1::EffectorStatus EffectorStatusOf(const gateway::Rig& rig) {
  const gateway::effector::EffectorState effector = rig.effector().State();
  const double time_scale = rig.options().time_scale;
  v1::EffectorStatus status;
  status.set_connected(effector.connected);
  status.set_port(rig.options().effector_port);
  status.set_firmware(effector.firmware);
  status.set_fingers(rig.options().fingers);
  for (const bool pressed : effector.pressed) status.add_pressed(pressed);
  if (const gateway::timing::ClockEstimate clock = rig.effector().Clock(); clock.valid) {
    status.set_clock_drift(clock.rate / time_scale - 1);
    status.set_clock_drift_uncertainty(clock.rate_uncertainty / time_scale);
    status.set_clock_uncertainty_s(clock.offset_uncertainty_s);
    status.set_round_trips(clock.round_trips);
    status.set_shortest_round_trip_s(clock.shortest_round_trip_s);
  }
  status.set_bad_frames(effector.bad_frames);
  status.set_repeated_events(effector.repeated_events);
  status.set_reconnections(effector.reconnections);
  return status;
}

v1::CameraStatus CameraStatusOf(const gateway::camera::CameraDevice& camera,
                                const source::SourceStatus& source) {
  v1::CameraStatus status;
  status.set_connected(true);
  status.set_kind(static_cast<v1::CameraKind>(camera.kind()));
  status.set_description(camera.Description());
  status.set_width(source.image_width);
  status.set_height(source.image_height);
  status.set_frames(camera.frames());
  status.set_stale_frames(camera.stale_frames());
  return status;
}

}  // namespace

grpc::Status RigControlService::AcquireLease(grpc::ServerContext* context,
                                             const v1::AcquireLeaseRequest* request, v1::Lease* response) {
  const std::string before = leases_->Holder();
  const grpc::Status status = ControlService::AcquireLease(context, request, response);
  if (status.ok())
    rig_->audit()
        .Write("lease_acquired", {{"holder", response->holder()},
                                  {"epoch", absl::StrCat(response->epoch())},
                                  {"taken_from", request->take() ? before : ""},
                                  {"peer", PeerOf(*context)}})
        .IgnoreError();
  return status;
}

grpc::Status RigControlService::ReleaseLease(grpc::ServerContext* context,
                                             const v1::ReleaseLeaseRequest* request,
                                             v1::ReleaseLeaseResponse* response) {
  const std::string holder = leases_->Holder();
  const grpc::Status status = ControlService::ReleaseLease(context, request, response);
  if (status.ok()) rig_->audit().Write("lease_released", {{"holder", holder}}).IgnoreError();
  return status;
}

grpc::Status RigControlService::Stop(grpc::ServerContext* context, const v1::StopRequest* request,
                                     v1::StopResponse* response) {
  // The arm first, then words. A stop is never refused, so what is too long is cut.
  const std::string reason =
      request->reason().empty() ? "no reason given" : Printable(request->reason(), kMaxStopReasonBytes);
  const std::string said =
      request->holder().empty() ? "somebody" : Printable(request->holder(), kMaxHolderBytes);
  const Caller caller = resources_->access->CallerOf(*context);
  const std::string who = request->holder().empty() && caller.name.empty()
                              ? PeerOf(*context)
                              : absl::StrCat(WithCaller(said, caller), " at ", PeerOf(*context));
  const gateway::StopOutcome outcome = rig_->Stop(reason, who);
  response->set_aborted_touches(outcome.motions);
  response->set_standstill(outcome.standstill.ok());
  response->set_not_confirmed(std::string(outcome.standstill.message()));
  spdlog::warn("stop from {}: {}", who, reason);
  return grpc::Status::OK;
}

grpc::Status RigControlService::Reset(grpc::ServerContext* context, const v1::ResetRequest* request,
                                      v1::State* response) {
  absl::Status status = CheckReset(*request);
  const bool stopped = !rig_->StopReason().empty();
  if (status.ok() && stopped) {
    // Whoever moves next acquires a lease after this moment: nothing that was retried moves because of it.
    leases_->Revoke();
    const std::string who = WithCaller(request->holder(), resources_->access->CallerOf(*context));
    status = rig_->Reset(request->reason(), who);
    spdlog::warn("reset by {} ({}) from {}: {}", who, request->reason(), PeerOf(*context),
                 status.ok() ? "released" : std::string(status.message()));
  }
  if (!status.ok()) return ToGrpc(status);
  return GetState(context, nullptr, response);
}

grpc::Status RigControlService::GetState(grpc::ServerContext* context, const v1::GetStateRequest* request,
                                         v1::State* response) {
  const grpc::Status status = ControlService::GetState(context, request, response);
  if (!resources_->draining) response->set_state(static_cast<v1::SourceState>(rig_->State()));
  response->set_stop_reason(rig_->StopReason());
  return status;
}

void RigService::Describe(v1::RigState* state) const {
  const source::SourceStatus status = rig_->Status();
  *state->mutable_arm() = ArmStatusOf(rig_->arm(), rig_->options().time_scale);
  const absl::StatusOr<gateway::arm::UrKinematics> kinematics = rig_->planner().Kinematics();
  state->mutable_arm()->set_calibrated_kinematics(kinematics.ok() && kinematics->calibrated());
  *state->mutable_limits() = LimitsOf(rig_->planner().limits());
  *state->mutable_effector() = EffectorStatusOf(*rig_);
  if (rig_->camera() != nullptr) *state->mutable_camera() = CameraStatusOf(*rig_->camera(), status);
  const absl::StatusOr<gateway::arm::ArmState> arm = rig_->arm().State();
  const gateway::effector::EffectorState effector = rig_->effector().State();
  state->set_object(status.object);
  if (const std::optional<gateway::calibration::UpFace> up_face = rig_->MountedUpFace(); up_face.has_value())
    state->set_up_face(static_cast<v1::UpFace>(*up_face));
  state->set_mounts_itself(!rig_->options().mount_command.empty());
  state->set_recovered_touches(status.recovered_touches);
  state->set_interrupted_touches(status.interrupted_touches);
  state->set_last_error(!arm.ok()             ? std::string(arm.status().message())
                        : !kinematics.ok()    ? std::string(kinematics.status().message())
                        : !effector.connected ? effector.why
                                              : status.last_error);
  state->set_time_scale(rig_->options().time_scale);
  state->set_fingers(rig_->fingers());
  state->set_spacing_m(rig_->spacing_m());
  state->set_provenance(rig_->Provenance());
  state->set_emulated(rig_->options().emulated);
  state->set_calibration(gateway::calibration::FormatCalibration(rig_->planner().calibration()));
  state->set_safety_notice(
      "Stop is a software stop: it is not safety-rated. Keep the emergency stop within reach.");
}

grpc::Status RigService::GetRig(grpc::ServerContext*, const v1::GetRigRequest*, v1::RigState* response) {
  Describe(response);
  return grpc::Status::OK;
}

grpc::Status RigService::CheckTouches(grpc::ServerContext*, const v1::CheckTouchesRequest* request,
                                      v1::CheckTouchesResponse* response) {
  return ToGrpc(DoCheck(*request, response));
}

absl::Status RigService::DoCheck(const v1::CheckTouchesRequest& request, v1::CheckTouchesResponse* response) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const source::ServedObject* object,
                              resources_->objects.Find(request.object(), "object"));
  TOUCHSTONE_RETURN_IF_ERROR(
      source::CheckTouchCount(request.touches_size(), resources_->options.OfSource(), 0));
  TOUCHSTONE_ASSIGN_OR_RETURN(gateway::Rig::DryRun run, rig_->BeginDryRun());
  const geometry::Bounds bounds = object->surface->bounds();
  for (int k = 0; k < request.touches_size(); ++k) {
    const std::string where = absl::StrCat("touches[", k, "]");
    TOUCHSTONE_ASSIGN_OR_RETURN(const touch::CommandedTouch touch, FromProto(request.touches(k), where));
    v1::TouchCheck* check = response->add_checks();
    const gateway::calibration::UpFace up_face = gateway::calibration::UpFaceFor(touch.approach);
    check->set_up_face(static_cast<v1::UpFace>(up_face));
    TOUCHSTONE_RETURN_IF_ERROR(rig_->MountInDryRun(request.object(), up_face, &run));
    const absl::StatusOr<gateway::arm::PlannedTouch> plan =
        rig_->Check(request.object(), bounds, touch, &run.at, where);
    check->set_possible(plan.ok());
    const gateway::arm::MotionPlanner& planner = rig_->planner();
    if (const auto lies = planner.ObjectPose(request.object(), bounds, up_face);
        request.path() && lies.ok()) {
      *check->mutable_base_from_object() = PoseToProto(*lies);
      *check->mutable_object_min_m() = ToProto(bounds.min_m);
      *check->mutable_object_max_m() = ToProto(bounds.max_m);
    }
    if (!plan.ok()) {
      check->set_reason(std::string(plan.status().message()));
      continue;
    }
    check->set_duration_s(plan->motion.duration_s);
    for (const std::string& note : plan->notes) check->add_notes(note);
    // The next one begins where this one ends: at its start.
    run.at.base_from_tip = plan->motion.transit.back();
    run.at.joints_rad = plan->start_joints_rad;
    if (!request.path()) continue;
    for (const Eigen::Isometry3d& pose : plan->motion.transit) *check->add_path() = PoseToProto(pose);
    *check->add_path() = PoseToProto(plan->motion.end);
    check->set_transit_poses(plan->motion.transit.size());
    TOUCHSTONE_RETURN_IF_ERROR(
        DescribePosture(*rig_, run.at.base_from_tip, plan->start_joints_rad, check->mutable_start_posture()));
    TOUCHSTONE_RETURN_IF_ERROR(
        DescribePosture(*rig_, plan->motion.end, plan->end_joints_rad, check->mutable_end_posture()));
  }
  return absl::OkStatus();
}

grpc::Status RigService::MountObject(grpc::ServerContext* context, const v1::MountObjectRequest* request,
                                     v1::RigState* response) {
  const absl::Status status = DoMount(context, *request);
  if (status.ok()) Describe(response);
  return ToGrpc(status);
}

absl::Status RigService::DoMount(grpc::ServerContext* context, const v1::MountObjectRequest& request) {
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(request.lease_token()));
  TOUCHSTONE_RETURN_IF_ERROR(resources_->objects.Find(request.object(), "object").status());
  if (request.up_face() < v1::UP_FACE_UNSPECIFIED || request.up_face() > v1::UP_FACE_MINUS_Z)
    return absl::InvalidArgumentError(absl::StrCat("up_face = ", static_cast<int>(request.up_face()),
                                                   ": the face that points up, 1 (+x) to 6 (-z)"));
  const gateway::calibration::UpFace up_face =
      request.up_face() == v1::UP_FACE_UNSPECIFIED
          ? gateway::calibration::UpFace::kPlusZ
          : static_cast<gateway::calibration::UpFace>(request.up_face());
  return rig_->Mount(request.object(), up_face, GuardOf(context, resources_, leases_, request.lease_token()));
}

grpc::Status RigService::PowerOn(grpc::ServerContext* context, const v1::PowerOnRequest* request,
                                 v1::RigState* response) {
  absl::Status status = leases_->Check(request->lease_token());
  if (status.ok()) status = rig_->PowerOn(GuardOf(context, resources_, leases_, request->lease_token()));
  if (status.ok()) Describe(response);
  return ToGrpc(status);
}

grpc::Status RigService::Home(grpc::ServerContext* context, const v1::HomeRequest* request,
                              v1::RigState* response) {
  absl::Status status = leases_->Check(request->lease_token());
  if (status.ok()) status = rig_->Home(GuardOf(context, resources_, leases_, request->lease_token()));
  if (status.ok()) Describe(response);
  return ToGrpc(status);
}

}  // namespace touchstone::service
