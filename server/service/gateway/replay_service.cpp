#include "server/service/gateway/replay_service.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/gateway/calibration/calibration.h"
#include "server/gateway/calibration/resting_face.h"
#include "server/service/calls/source_messages.h"
#include "server/service/core/convert.h"
#include "server/session/journal/command_bytes.h"
#include "server/source/physical_source.h"

namespace touchstone::service {

grpc::Status ReplayRigService::GetRig(grpc::ServerContext*, const v1::GetRigRequest*,
                                      v1::RigState* response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  *response = rig_;
  return grpc::Status::OK;
}

grpc::Status ReplayRigService::CheckTouches(grpc::ServerContext*, const v1::CheckTouchesRequest* request,
                                            v1::CheckTouchesResponse* response) {
  return ToGrpc(DoCheck(*request, response));
}

grpc::Status ReplayRigService::CheckViews(grpc::ServerContext*, const v1::CheckViewsRequest* request,
                                          v1::CheckTouchesResponse* response) {
  return ToGrpc(DoCheck(*request, response));
}

absl::Status ReplayRigService::DoCheck(const v1::CheckTouchesRequest& request,
                                       v1::CheckTouchesResponse* response) {
  TOUCHSTONE_RETURN_IF_ERROR(resources_->objects.Find(request.object(), "object").status());
  TOUCHSTONE_RETURN_IF_ERROR(
      source::CheckTouchCount(request.touches_size(), resources_->options.OfSource(), 0));
  for (int k = 0; k < request.touches_size(); ++k) {
    source::TouchCommand command;
    command.object = request.object();
    TOUCHSTONE_ASSIGN_OR_RETURN(command.touch,
                                FromProto(request.touches(k), absl::StrCat("touches[", k, "]")));
    command.bytes = session::CommandBytes(command.touch);
    v1::TouchCheck* const check = response->add_checks();
    check->set_up_face(static_cast<v1::UpFace>(gateway::calibration::UpFaceFor(command.touch.approach)));
    check->set_possible(recorded_->Has(command));
    if (!check->possible()) check->set_reason(absl::StrCat("no such touch is in the replay of ", name_));
  }
  return absl::OkStatus();
}

absl::Status ReplayRigService::DoCheck(const v1::CheckViewsRequest& request,
                                       v1::CheckTouchesResponse* response) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const source::ServedObject* object,
                              resources_->objects.Find(request.object(), "object"));
  const int max_views = resources_->options.OfSource().max_touches_per_request;
  if (request.views_size() > max_views)
    return OverLimit("views has", request.views_size(), "max_touches_per_request", max_views);
  for (int k = 0; k < request.views_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const image::Camera camera,
                                FromProto(request.views(k), absl::StrCat("views[", k, "]")));
    const source::ViewCommand command{"", request.object(), object->surface->bounds(),
                                      source::ObjectFromCamera(camera), std::nullopt};
    v1::TouchCheck* const check = response->add_checks();
    check->set_up_face(static_cast<v1::UpFace>(
        gateway::calibration::UpFaceFor(command.object_from_camera.rotation().col(2))));
    check->set_possible(recorded_->Has(command));
    if (!check->possible())
      check->set_reason(absl::StrCat("no picture from there is in the replay of ", name_));
  }
  return absl::OkStatus();
}

absl::Status ReplayRigService::NothingMoves() const {
  return absl::FailedPreconditionError(
      absl::StrCat("this is the replay of ", name_, ": there is no arm behind it, and nothing moves"));
}

grpc::Status ReplayRigService::MountObject(grpc::ServerContext*, const v1::MountObjectRequest* request,
                                           v1::RigState* response) {
  absl::Status status = leases_->Check(request->lease_token());
  if (status.ok()) status = resources_->objects.Find(request->object(), "object").status();
  if (status.ok() && !v1::UpFace_IsValid(request->up_face()))
    status = absl::InvalidArgumentError("up_face: the face that points up, 1 (+x) to 6 (-z)");
  if (!status.ok()) return ToGrpc(status);
  const std::lock_guard<std::mutex> lock(mutex_);
  rig_.set_object(request->object());
  rig_.set_up_face(request->up_face() == v1::UP_FACE_UNSPECIFIED ? v1::UP_FACE_PLUS_Z : request->up_face());
  *response = rig_;
  return grpc::Status::OK;
}

grpc::Status ReplayRigService::PowerOn(grpc::ServerContext*, const v1::PowerOnRequest*, v1::RigState*) {
  return ToGrpc(NothingMoves());
}

grpc::Status ReplayRigService::Home(grpc::ServerContext*, const v1::HomeRequest*, v1::RigState*) {
  return ToGrpc(NothingMoves());
}

grpc::Status ReplayControlService::Reset(grpc::ServerContext* context, const v1::ResetRequest* request,
                                         v1::State* response) {
  if (const absl::Status valid = CheckReset(*request); !valid.ok()) return ToGrpc(valid);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_.set_state(v1::SOURCE_STATE_IDLE);
    state_.clear_stop_reason();
  }
  return GetState(context, nullptr, response);
}

grpc::Status ReplayControlService::GetState(grpc::ServerContext* context, const v1::GetStateRequest* request,
                                            v1::State* response) {
  const grpc::Status status = ControlService::GetState(context, request, response);
  if (!status.ok() || resources_->draining || !has_state_) return status;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (response->state() == v1::SOURCE_STATE_IDLE) response->set_state(state_.state());
  response->set_stop_reason(state_.stop_reason());
  response->set_touches(state_.touches());
  response->set_images(state_.images());
  response->set_uptime_s(state_.uptime_s());
  return status;
}

}  // namespace touchstone::service
