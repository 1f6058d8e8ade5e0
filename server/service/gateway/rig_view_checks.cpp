// Rig.CheckViews: every check of a photograph, without motion.
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/geometry/pose.h"
#include "server/image/renderers/renderer.h"
#include "server/service/calls/source_messages.h"
#include "server/service/core/convert.h"
#include "server/service/gateway/rig_service.h"
#include "server/session/recorded/base_pose.h"
#include "server/source/physical_source.h"

namespace touchstone::service {

grpc::Status RigService::CheckViews(grpc::ServerContext*, const v1::CheckViewsRequest* request,
                                    v1::CheckTouchesResponse* response) {
  return ToGrpc(DoCheck(*request, response));
}

absl::Status RigService::DoCheck(const v1::CheckViewsRequest& request, v1::CheckTouchesResponse* response) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const source::ServedObject* object,
                              resources_->objects.Find(request.object(), "object"));
  const int max_views = resources_->options.OfSource().max_touches_per_request;
  if (request.views_size() > max_views)
    return OverLimit("views has", request.views_size(), "max_touches_per_request", max_views);
  TOUCHSTONE_ASSIGN_OR_RETURN(gateway::Rig::DryRun run, rig_->BeginDryRun());
  for (int k = 0; k < request.views_size(); ++k) {
    const std::string where = absl::StrCat("views[", k, "]");
    TOUCHSTONE_ASSIGN_OR_RETURN(const image::Camera camera, FromProto(request.views(k), where));
    if (const absl::Status valid = image::ValidateImageRequest(camera, image::ImageOptions()); !valid.ok())
      return absl::Status(valid.code(), absl::StrCat(where, ": ", valid.message()));
    const source::ViewCommand command{"", request.object(), object->surface->bounds(),
                                      source::ObjectFromCamera(camera), std::nullopt};
    v1::TouchCheck* check = response->add_checks();
    const gateway::calibration::UpFace up_face =
        gateway::calibration::UpFaceFor(command.object_from_camera.rotation().col(2));
    check->set_up_face(static_cast<v1::UpFace>(up_face));
    TOUCHSTONE_RETURN_IF_ERROR(rig_->MountInDryRun(request.object(), up_face, &run));
    const absl::StatusOr<gateway::arm::PlannedTouch> plan = rig_->CheckView(command, &run.at, where);
    check->set_possible(plan.ok());
    if (!plan.ok()) {
      check->set_reason(std::string(plan.status().message()));
      continue;
    }
    check->set_duration_s(plan->motion.duration_s);
    run.at.base_from_tip = plan->motion.transit.back();
    run.at.joints_rad = plan->start_joints_rad;
    if (!request.path()) continue;
    for (const Eigen::Isometry3d& pose : plan->motion.transit)
      *check->add_path() = session::BasePoseMessage(geometry::PoseVectorOf(pose));
    check->set_transit_poses(plan->motion.transit.size());
  }
  return absl::OkStatus();
}

}  // namespace touchstone::service
