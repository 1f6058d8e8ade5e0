#include "server/service/gateway/freedrive_service.h"

#include <optional>
#include <string>

#include "server/geometry/pose.h"
#include "server/service/calls/call_guard.h"
#include "server/service/core/convert.h"
#include "server/session/recorded/base_pose.h"

namespace touchstone::service {

v1::GuideState FreedriveService::StateOf(const gateway::arm::ArmState& arm) const {
  v1::GuideState state;
  *state.mutable_base_from_tip() = session::BasePoseMessage(geometry::PoseVectorOf(arm.base_from_tip));
  state.set_tip_speed_m_s(arm.tip_velocity_m_s.norm());
  for (const bool pressed : rig_->effector().State().pressed) state.add_pressed(pressed);
  const std::string object = rig_->Status().object;
  const std::optional<gateway::calibration::UpFace> up_face = rig_->MountedUpFace();
  const absl::StatusOr<const source::ServedObject*> served = resources_->objects.Find(object, "object");
  if (!up_face.has_value() || !served.ok()) return state;
  const absl::StatusOr<Eigen::Isometry3d> base_from_object =
      rig_->planner().ObjectPose(object, (*served)->surface->bounds(), *up_face);
  if (!base_from_object.ok()) return state;
  state.set_object(object);
  state.set_up_face(static_cast<v1::UpFace>(*up_face));
  *state.mutable_object_from_tip() =
      session::BasePoseMessage(geometry::PoseVectorOf(base_from_object->inverse() * arm.base_from_tip));
  return state;
}

grpc::Status FreedriveService::Guide(grpc::ServerContext* context, const v1::GuideRequest* request,
                                     grpc::ServerWriter<v1::GuideState>* writer) {
  absl::Status status = leases_->Check(request->lease_token());
  if (status.ok())
    status = rig_->Guide([&](const gateway::arm::ArmState& arm) { writer->Write(StateOf(arm)); },
                         GuardOf(context, resources_, leases_, request->lease_token()));
  return ToGrpc(status);
}

}  // namespace touchstone::service
