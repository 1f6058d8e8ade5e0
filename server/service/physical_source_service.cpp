#include "server/service/physical_source_service.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/gateway/camera/camera.h"
#include "server/service/convert.h"
#include "server/service/permit.h"
#include "server/service/physical_dataset.h"

namespace touchstone {
namespace {

absl::StatusOr<std::string> SessionName(const std::string& name) {
  if (name.empty()) return std::string("default");
  TOUCHSTONE_RETURN_IF_ERROR(CheckResourceName(name, "session"));
  return name;
}

std::string RandomId() {
  static std::atomic<uint64_t> count{0};
  return absl::StrCat("touch-", std::chrono::system_clock::now().time_since_epoch().count(), "-", ++count);
}

}  // namespace

v1::TouchResult ToProto(const JournalTouch& touch, const std::string& session) {
  v1::TouchResult message;
  const JournalResult& result = touch.result;
  double first_s = std::numeric_limits<double>::infinity();
  bool complete = true;
  for (const JournalFinger& finger : result.fingers) {
    if (std::isnan(finger.contact_time_s))
      complete = false;
    else
      first_s = std::min(first_s, finger.contact_time_s);
  }
  v1::Measured* measured = message.mutable_measured();
  for (const JournalFinger& finger : result.fingers) {
    message.add_contact_time_s(finger.contact_time_s);
    message.add_descriptor_s(finger.contact_time_s - first_s);  // NaN stays NaN
    v1::BasePose* pose = measured->add_base_from_tip_at_contact();
    const auto& p = finger.base_from_tip;
    if (std::isnan(p[0])) continue;
    *pose->mutable_position_m() = ToProto(Eigen::Vector3d(p[0], p[1], p[2]));
    *pose->mutable_rotation_rad() = ToProto(Eigen::Vector3d(p[3], p[4], p[5]));
  }
  message.set_complete(complete);
  measured->set_touch_id(touch.id);
  measured->set_session(session);
  measured->set_speed_m_s(result.speed_m_s);
  measured->set_session_time_s(result.session_time_s);
  measured->set_start_unix_s(result.start_unix_s);
  measured->set_time_uncertainty_s(result.time_uncertainty_s);
  measured->set_synchronisation_uncertainty_s(result.synchronisation_uncertainty_s);
  measured->set_effector_drift(result.effector_drift);
  measured->set_recovered(result.recovered);
  return message;
}

absl::StatusOr<Image> PictureOf(const Frame& frame, const Intrinsics& intrinsics,
                                const DatasetImage& wanted) {
  const ImageOptions& options = wanted.options;
  if (options.depth || options.mask)
    return absl::InvalidArgumentError(
        "image.depth, image.mask: this source's camera sees colours only; ask for none");
  if (options.shading_style != ShadingStyle::kShaded)
    return absl::InvalidArgumentError(
        "image.shading_style: this source's camera shows what it sees; leave it unspecified");
  Image picture;
  picture.width = options.width;
  picture.height = options.height;
  picture.channels = options.format == PixelFormat::kRgb ? 3 : 1;
  picture.pixels = Rectify(frame, intrinsics, options.width, options.height, wanted.vertical_fov_rad,
                           options.format == PixelFormat::kGrey);
  return picture;
}

Eigen::Isometry3d ObjectFromCamera(const Camera& camera) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d ahead = (camera.at_m - camera.eye_m).normalized();
  const Eigen::Vector3d right = ahead.cross(camera.up).normalized();
  pose.linear() << right, ahead.cross(right), ahead;
  pose.translation() = camera.eye_m;
  return pose;
}

grpc::Status PhysicalSourceService::Describe(grpc::ServerContext*, const v1::DescribeRequest*,
                                             v1::DescribeResponse* response) {
  const ServerOptions& options = resources_->options;
  const SourceStatus facts = source_->Status();
  response->set_kind("physical");
  response->set_version(kVersion);
  for (const char* plan : {"faces", "list"}) response->add_plans(plan);
  response->set_max_touches_per_request(options.max_touches_per_request);
  if (source_->has_camera()) {
    response->set_max_images_per_request(options.max_images_per_request);
    response->set_max_image_side(kMaxImageSide);
  }
  response->set_max_batch_size(options.max_batch_size);
  response->set_max_fingers(source_->fingers());
  response->set_lease_required(source_->moves());
  response->set_touch_duration_s(source_->moves() && facts.touch_duration_s == 0 ? 8
                                                                                 : facts.touch_duration_s);
  response->set_clock_uncertainty_s(facts.clock_uncertainty_s);
  return grpc::Status::OK;
}

grpc::Status PhysicalSourceService::Touch(grpc::ServerContext* context, const v1::TouchRequest* request,
                                          v1::TouchResponse* response) {
  return ToGrpc(DoTouch(context, *request, response));
}

absl::Status PhysicalSourceService::DoTouch(grpc::ServerContext* context, const v1::TouchRequest& request,
                                            v1::TouchResponse* response) {
  const RunningGuard running(&resources_->running_requests);
  const MotionGuard guard = GuardOf(context, resources_, leases_, request.lease_token());
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(request.lease_token()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object,
                              resources_->objects.Find(request.object(), "object"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string session, SessionName(request.session()));
  const int most = resources_->options.max_touches_per_request;
  if (request.touches_size() == 0)
    return absl::InvalidArgumentError("touches is empty: give at least one touch");
  if (request.touches_size() > most)
    return absl::InvalidArgumentError(
        absl::StrCat("touches has ", request.touches_size(), ": at most ", most, " a request"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouchIds(request));

  // All are checked before the first one moves anything.
  std::vector<TouchCommand> orders;
  std::map<std::string, uint64_t> repeats;
  for (int k = 0; k < request.touches_size(); ++k) {
    TouchCommand order;
    TOUCHSTONE_ASSIGN_OR_RETURN(order.touch, FromProto(request.touches(k), absl::StrCat("touches[", k, "]")));
    order.session = session;
    order.id = request.touch_ids_size() > 0 ? request.touch_ids(k) : RandomId();
    order.object = request.object();
    order.bounds = object->surface->bounds();
    order.bytes = CommandBytes(order.touch);
    order.repeat = repeats[order.bytes]++;
    orders.push_back(std::move(order));
  }
  for (const TouchCommand& order : orders) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const JournalTouch touch, source_->Touch(order, guard));
    *response->add_results() = ToProto(touch, session);
    ++resources_->touches;
  }
  return absl::OkStatus();
}

grpc::Status PhysicalSourceService::Capture(grpc::ServerContext* context, const v1::CaptureRequest* request,
                                            v1::CaptureResponse* response) {
  return ToGrpc(DoCapture(context, *request, response));
}

absl::Status PhysicalSourceService::DoCapture(grpc::ServerContext* context, const v1::CaptureRequest& request,
                                              v1::CaptureResponse* response) {
  const RunningGuard running(&resources_->running_requests);
  const MotionGuard guard = GuardOf(context, resources_, leases_, request.lease_token());
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(request.lease_token()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object,
                              resources_->objects.Find(request.object(), "object"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const DatasetImage image, FromProto(request.image(), resources_));
  const int most = resources_->options.max_images_per_request;
  if (request.views_size() == 0) return absl::InvalidArgumentError("views is empty: give at least one view");
  if (request.views_size() > most)
    return absl::InvalidArgumentError(
        absl::StrCat("views has ", request.views_size(), ": at most ", most, " a request"));
  std::vector<Camera> cameras;
  for (int k = 0; k < request.views_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(Camera camera, FromProto(request.views(k), absl::StrCat("views[", k, "]")));
    camera.vertical_fov_rad = image.vertical_fov_rad;
    if (const absl::Status status = ValidateImageRequest(camera, image.options); !status.ok())
      return absl::Status(status.code(), absl::StrCat("views[", k, "]: ", status.message()));
    cameras.push_back(camera);
  }
  v1::Column* column = response->add_columns();
  column->set_name("image");
  const bool raw = image.encoding == ImageEncoding::kRaw;
  column->set_type(raw ? v1::DATA_TYPE_UINT8 : v1::DATA_TYPE_BYTES);
  if (raw)
    for (const int side :
         {image.options.height, image.options.width, image.options.format == PixelFormat::kRgb ? 3 : 1})
      column->add_shape(side);
  std::vector<uint64_t> offsets;
  for (const Camera& camera : cameras) {
    ViewCommand order{"default", request.object(), object->surface->bounds(), ObjectFromCamera(camera)};
    TOUCHSTONE_ASSIGN_OR_RETURN(const Frame frame, source_->Photograph(order, guard));
    TOUCHSTONE_ASSIGN_OR_RETURN(const Image picture, PictureOf(frame, source_->IntrinsicsOf(frame), image));
    TOUCHSTONE_RETURN_IF_ERROR(AppendPicture(picture, image, "image", column->mutable_data(), &offsets));
    ++resources_->images;
  }
  column->mutable_offsets()->Add(offsets.begin(), offsets.end());
  response->set_rows(request.views_size());
  return absl::OkStatus();
}

grpc::Status PhysicalSourceService::StreamDataset(grpc::ServerContext* context,
                                                  const v1::StreamDatasetRequest* request,
                                                  grpc::ServerWriter<v1::StreamDatasetResponse>* writer) {
  return ToGrpc(DoStream(context, *request, writer));
}

absl::Status PhysicalSourceService::DoStream(grpc::ServerContext* context,
                                             const v1::StreamDatasetRequest& request,
                                             grpc::ServerWriter<v1::StreamDatasetResponse>* writer) {
  const RunningGuard running(&resources_->running_streams);
  const ServerOptions& options = resources_->options;
  if (resources_->running_streams > static_cast<uint32_t>(options.max_streams))
    return absl::ResourceExhaustedError(absl::StrCat(
        "this source runs ", options.max_streams, " dataset streams already (max_streams): try again later"));
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(request.lease_token()));
  if (request.batch_size() > static_cast<uint32_t>(options.max_batch_size))
    return absl::InvalidArgumentError(
        absl::StrCat("batch_size = ", request.batch_size(), ": at most ", options.max_batch_size));
  if (request.spec().plan().has_sphere())
    return absl::InvalidArgumentError(
        "plan.sphere makes no sense at this source: an arm cannot come from everywhere; faces and list would "
        "be right");
  v1::DatasetSpec spec = request.spec();
  spec.clear_model();  // a rig simulates nothing
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<const DatasetSpecification> specification,
                              FromProto(spec, resources_));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string session, SessionName(request.session()));
  DatasetPart part;
  part.start_index = request.start_index();
  part.stop_index = request.stop_index();
  part.batch_size = request.batch_size();
  part.batch_stride = request.batch_stride();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      PhysicalDataset dataset,
      PhysicalDataset::Create(specification, {spec.objects().begin(), spec.objects().end()}, part, session,
                              DatasetKey(spec), source_));
  v1::StreamDatasetResponse response;
  v1::DatasetHeader* header = response.mutable_header();
  *header = HeaderOf(*specification);
  header->clear_model_name();
  header->clear_model_hash();
  header->clear_model_yaml();
  header->clear_renderer();
  if (!writer->Write(response)) return absl::CancelledError("the client is gone");
  response.clear_header();

  const std::vector<ColumnInfo> columns = ColumnsOf(*specification);
  const MotionGuard guard = GuardOf(context, resources_, leases_, request.lease_token());
  for (;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<DatasetBatch> batch, dataset.Next(guard));
    if (!batch.has_value()) return absl::OkStatus();
    const uint32_t rows = batch->rows;
    *response.mutable_batch() = ToProto(*std::move(batch), columns);
    if (!writer->Write(response)) return absl::CancelledError("the client is gone");
    resources_->touches += rows;
    if (specification->columns.image) resources_->images += rows;
  }
}

}  // namespace touchstone
