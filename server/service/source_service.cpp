#include "server/service/source_service.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <cstring>

#include "server/base/status.h"
#include "server/service/convert.h"

namespace touchstone {
namespace {

constexpr int kTouchBlock = 1024;

// The results of a batch, appended to the response.
void AppendResults(const TouchBatch& batch, v1::TouchResponse* response) {
  for (int touch = 0; touch < batch.size(); ++touch) {
    v1::TouchResult* result = response->add_results();
    double descriptor_s[kMaxFingers];
    result->set_complete(Descriptor(batch, touch, descriptor_s));
    for (int finger = 0; finger < batch.fingers(); ++finger) {
      const int k = batch.At(finger, touch);
      result->add_descriptor_s(descriptor_s[finger]);
      result->add_contact_time_s(batch.reported_time_s[k]);
      result->add_travel_m(batch.travel_m[k]);
      for (int i = 0; i < 3; ++i) {
        result->add_contact_point_m(batch.contact_m[k][i]);
        result->add_normal(batch.normal[k][i]);
      }
    }
  }
}

}  // namespace

grpc::Status SourceService::Describe(grpc::ServerContext*, const v1::DescribeRequest*,
                                     v1::DescribeResponse* response) {
  const ServerOptions& options = resources_->options;
  response->set_kind("virtual");
  response->set_version(kVersion);
  for (const char* plan : {"sphere", "faces", "list"}) response->add_plans(plan);
  response->set_default_model(resources_->default_model->name);
  response->set_default_model_hash(resources_->default_model->Hash());
  const auto renderer = resources_->RendererFor(RendererKind::kAuto);
  if (renderer.ok()) response->set_renderer(RendererKindOf(**renderer));
  response->set_renderer_description(renderer.ok() ? (*renderer)->description()
                                                   : "none: " + std::string(renderer.status().message()));
  response->set_max_touches_per_request(options.max_touches_per_request);
  response->set_max_images_per_request(renderer.ok() ? options.max_images_per_request : 0);
  response->set_max_image_side(renderer.ok() ? kMaxImageSide : 0);
  response->set_max_batch_size(options.max_batch_size);
  response->set_max_fingers(kMaxFingers);
  return grpc::Status::OK;
}

grpc::Status SourceService::ListObjects(grpc::ServerContext*, const v1::ListObjectsRequest*,
                                        v1::ListObjectsResponse* response) {
  for (const auto& [name, served] : resources_->objects.all()) {
    v1::Object* object = response->add_objects();
    object->set_name(name);
    object->set_vertices(served.surface->mesh().vertices_m.size());
    object->set_triangles(served.surface->mesh().triangles.size());
    *object->mutable_bounds_min_m() = ToProto(served.surface->bounds().min_m);
    *object->mutable_bounds_max_m() = ToProto(served.surface->bounds().max_m);
    object->set_closed(served.closed);
    object->set_mesh_hash(served.surface->hash());
    object->set_origin(served.origin);
  }
  return grpc::Status::OK;
}

grpc::Status SourceService::ExpandPlan(grpc::ServerContext*, const v1::ExpandPlanRequest* request,
                                       v1::ExpandPlanResponse* response) {
  const absl::StatusOr<Plan> plan = FromProto(request->plan());
  if (!plan.ok()) return ToGrpc(plan.status());
  Bounds bounds;
  if (plan->kind != Plan::Kind::kList) {
    const auto object = resources_->objects.Find(request->object(), "object");
    if (!object.ok()) return ToGrpc(object.status());
    bounds = (*object)->surface->bounds();
  }
  const auto generator = MakePoseGenerator(*plan, bounds, request->seed());
  uint64_t count = request->count();
  if (generator->Count() != 0) {
    if (request->first_index() > generator->Count())
      return ToGrpc(absl::OutOfRangeError(absl::StrCat("first_index = ", request->first_index(),
                                                       ": the plan has ", generator->Count(), " touches")));
    const uint64_t left = generator->Count() - request->first_index();
    count = count == 0 ? left : std::min(count, left);
  }
  const uint64_t most = resources_->options.max_touches_per_request;
  if (count > most)
    return ToGrpc(absl::InvalidArgumentError(absl::StrCat(
        "count = ", count, ": at most ", most, " touches a request; ask in parts by first_index")));
  for (uint64_t k = 0; k < count; ++k)
    *response->add_touches() = ToProto(TouchOfPlan(*plan, *generator, request->first_index() + k, 0));
  return grpc::Status::OK;
}

// Why a request must not go on; OK if it may.
absl::Status SourceService::Ready(uint64_t stops_before) const {
  if (resources_->stop_count != stops_before) return absl::AbortedError("stopped: Control.Stop was called");
  return absl::OkStatus();
}

grpc::Status SourceService::Touch(grpc::ServerContext* context, const v1::TouchRequest* request,
                                  v1::TouchResponse* response) {
  return ToGrpc(DoTouch(context, *request, response));
}

absl::Status SourceService::DoTouch(grpc::ServerContext* context, const v1::TouchRequest& request,
                                    v1::TouchResponse* response) {
  const RunningGuard running(&resources_->running_requests);
  const uint64_t stops_before = resources_->stop_count;
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(request.lease_token()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object,
                              resources_->objects.Find(request.object(), "object"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<const Model> model,
                              FromProto(request.model(), *resources_));
  const int most = resources_->options.max_touches_per_request;
  if (request.touches_size() == 0)
    return absl::InvalidArgumentError("touches is empty: give at least one touch");
  if (request.touches_size() > most)
    return absl::InvalidArgumentError(
        absl::StrCat("touches has ", request.touches_size(), ": at most ", most, " a request"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouchIds(request));
  std::vector<CommandedTouch> touches;
  for (int k = 0; k < request.touches_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(CommandedTouch touch,
                                FromProto(request.touches(k), absl::StrCat("touches[", k, "]")));
    touches.push_back(std::move(touch));
  }

  const TouchSimulator simulator(model);
  TouchBatch batch;
  TouchWorkspace workspace;
  std::vector<double> press_m(model->fingers, 0.0);  // of the touch before
  for (int begin = 0; begin < request.touches_size();) {
    if (context->IsCancelled()) return absl::CancelledError("the request was cancelled");
    TOUCHSTONE_RETURN_IF_ERROR(Ready(stops_before));
    // A model with history sees one touch after the other; touches of different strokes never share a batch.
    int count = 1;
    while (!simulator.needs_previous_press() && count < kTouchBlock &&
           begin + count < request.touches_size() &&
           touches[begin + count].stroke_m == touches[begin].stroke_m)
      ++count;
    simulator.Prepare(count, &batch);
    batch.surface = object->surface;
    batch.seed = request.seed();
    batch.stroke_m = touches[begin].stroke_m;
    for (int k = 0; k < count; ++k) {
      const CommandedTouch& touch = touches[begin + k];
      batch.index[k] = request.first_index() + begin + k;
      batch.target_m[k] = touch.target_m;
      batch.approach[k] = touch.approach;
      batch.lateral[k] = touch.lateral;
      batch.standoff_m[k] = touch.standoff_m;
      batch.speed_m_s[k] = touch.speed_m_s;
      batch.session_time_s[k] = touch.session_time_s;
      for (const std::string& name : simulator.needed_covariates()) {
        const auto value = touch.covariates.find(name);
        if (value == touch.covariates.end())
          return absl::InvalidArgumentError(absl::StrCat("touches[", begin + k, "].covariates['", name,
                                                         "'] is missing: a formula of model '", model->name,
                                                         "' uses it"));
        std::vector<double>& values = batch.covariates[name];
        values.resize(count);
        values[k] = value->second;
      }
    }
    if (simulator.needs_previous_press())
      for (int finger = 0; finger < model->fingers; ++finger)
        batch.previous_press_m[finger] = press_m[finger];
    TOUCHSTONE_RETURN_IF_ERROR(simulator.Run(&batch, &workspace));
    for (int finger = 0; finger < model->fingers; ++finger)
      press_m[finger] = batch.press_m[batch.At(finger, count - 1)];
    AppendResults(batch, response);
    begin += count;
  }
  response->set_model_hash(model->Hash());
  resources_->touches += touches.size();
  return absl::OkStatus();
}

grpc::Status SourceService::Capture(grpc::ServerContext* context, const v1::CaptureRequest* request,
                                    v1::CaptureResponse* response) {
  return ToGrpc(DoCapture(context, *request, response));
}

absl::Status SourceService::DoCapture(grpc::ServerContext* context, const v1::CaptureRequest& request,
                                      v1::CaptureResponse* response) {
  const RunningGuard running(&resources_->running_requests);
  const uint64_t stops_before = resources_->stop_count;
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(request.lease_token()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object,
                              resources_->objects.Find(request.object(), "object"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const DatasetImage image, FromProto(request.image(), resources_));
  const int most = resources_->options.max_images_per_request;
  if (request.views_size() == 0) return absl::InvalidArgumentError("views is empty: give at least one view");
  if (request.views_size() > most)
    return absl::InvalidArgumentError(
        absl::StrCat("views has ", request.views_size(), ": at most ", most, " a request"));
  const uint64_t bytes = uint64_t{3} * image.options.width * image.options.height * request.views_size() *
                         (image.options.depth ? 3 : 1);
  if (bytes > (uint64_t{192} << 20))
    return absl::InvalidArgumentError(
        absl::StrCat("views has ", request.views_size(), " of ", image.options.width, " x ",
                     image.options.height, " pixels: too much for one answer; ask for fewer at a time"));

  std::vector<Camera> cameras;
  for (int k = 0; k < request.views_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(Camera camera, FromProto(request.views(k), absl::StrCat("views[", k, "]")));
    camera.vertical_fov_rad = image.vertical_fov_rad;
    if (const absl::Status status = ValidateImageRequest(camera, image.options); !status.ok())
      return absl::Status(status.code(), absl::StrCat("views[", k, "]: ", status.message()));
    cameras.push_back(camera);
  }

  DatasetSpecification columns_of;  // the same columns as in a dataset
  columns_of.model = resources_->default_model;
  columns_of.columns.image = true;
  columns_of.image = image;
  for (const ColumnInfo& info : ColumnsOf(columns_of)) *response->add_columns() = ColumnToProto(info);
  std::vector<std::vector<uint64_t>> offsets(response->columns_size());
  for (const Camera& camera : cameras) {
    if (context->IsCancelled()) return absl::CancelledError("the request was cancelled");
    TOUCHSTONE_RETURN_IF_ERROR(Ready(stops_before));
    TOUCHSTONE_ASSIGN_OR_RETURN(const Image picture,
                                image.renderer->Render(object->surface, camera, image.options));
    for (int k = 0; k < response->columns_size(); ++k) {
      v1::Column* column = response->mutable_columns(k);
      TOUCHSTONE_RETURN_IF_ERROR(
          AppendPicture(picture, image, column->name(), column->mutable_data(), &offsets[k]));
    }
  }
  for (int k = 0; k < response->columns_size(); ++k)
    response->mutable_columns(k)->mutable_offsets()->Add(offsets[k].begin(), offsets[k].end());
  response->set_rows(request.views_size());
  resources_->images += request.views_size();
  return absl::OkStatus();
}

grpc::Status SourceService::StreamDataset(grpc::ServerContext* context,
                                          const v1::StreamDatasetRequest* request,
                                          grpc::ServerWriter<v1::StreamDatasetResponse>* writer) {
  return ToGrpc(DoStream(context, *request, writer));
}

absl::Status SourceService::DoStream(grpc::ServerContext* context, const v1::StreamDatasetRequest& request,
                                     grpc::ServerWriter<v1::StreamDatasetResponse>* writer) {
  const RunningGuard running(&resources_->running_streams);
  const ServerOptions& options = resources_->options;
  if (resources_->running_streams > static_cast<uint32_t>(options.max_streams))
    return absl::ResourceExhaustedError(
        absl::StrCat("this server runs ", options.max_streams,
                     " dataset streams already (max_streams): try again, or at another server"));
  if (request.batch_size() > static_cast<uint32_t>(options.max_batch_size))
    return absl::InvalidArgumentError(
        absl::StrCat("batch_size = ", request.batch_size(), ": at most ", options.max_batch_size));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<const DatasetSpecification> specification,
                              FromProto(request.spec(), resources_));
  DatasetPart part;
  part.start_index = request.start_index();
  part.stop_index = request.stop_index();
  part.batch_size = request.batch_size();
  part.batch_stride = request.batch_stride();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<DatasetStream> stream,
                              DatasetStream::Create(specification, part, resources_->pool.get()));

  v1::StreamDatasetResponse response;
  *response.mutable_header() = HeaderOf(*specification);
  const std::vector<ColumnInfo> columns = ColumnsOf(*specification);
  if (!writer->Write(response)) return absl::CancelledError("the client is gone");
  response.clear_header();

  for (;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<DatasetBatch> batch,
                                stream->Next([&] { return context->IsCancelled(); }));
    if (!batch.has_value()) return absl::OkStatus();
    const uint32_t rows = batch->rows;
    *response.mutable_batch() = ToProto(*std::move(batch), columns);
    if (!writer->Write(response)) return absl::CancelledError("the client is gone");
    resources_->touches += rows;
    if (specification->columns.image) resources_->images += rows;
  }
}

}  // namespace touchstone
