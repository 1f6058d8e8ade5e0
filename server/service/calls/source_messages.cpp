// Results of a source to the messages of touchstone.v1.Source.
#include "server/service/calls/source_messages.h"

#include "server/service/core/convert.h"
#include "server/session/recorded/base_pose.h"
#include "server/touch/batch_row.h"

namespace touchstone::service {
namespace {

v1::Column ColumnToProto(const dataset::ColumnInfo& info) {
  v1::Column column;
  column.set_name(info.name);
  switch (info.type) {
    case dataset::ColumnType::kFloat32:
      column.set_type(v1::DATA_TYPE_FLOAT32);
      break;
    case dataset::ColumnType::kUint8:
      column.set_type(v1::DATA_TYPE_UINT8);
      break;
    case dataset::ColumnType::kInt32:
      column.set_type(v1::DATA_TYPE_INT32);
      break;
    case dataset::ColumnType::kUint64:
      column.set_type(v1::DATA_TYPE_UINT64);
      break;
    case dataset::ColumnType::kBytes:
      column.set_type(v1::DATA_TYPE_BYTES);
      break;
  }
  column.mutable_shape()->Add(info.shape.begin(), info.shape.end());
  return column;
}

v1::RendererKind RendererKindOf(const std::string& name) {
  return name.empty()    ? v1::RENDERER_KIND_UNSPECIFIED
         : name == "egl" ? v1::RENDERER_KIND_EGL
                         : v1::RENDERER_KIND_CPU;
}

const char* PlanName(touch::Plan::Kind kind) {
  switch (kind) {
    case touch::Plan::Kind::kSphere:
      return "sphere";
    case touch::Plan::Kind::kFaces:
      return "faces";
    case touch::Plan::Kind::kList:
      break;
  }
  return "list";
}

// How a physical source made a touch.
v1::Measured MeasuredToProto(const session::JournalTouch& touch, const std::string& session) {
  v1::Measured measured;
  const session::JournalResult& result = touch.result;
  for (const session::JournalFinger& finger : result.fingers)
    *measured.add_base_from_tip_at_contact() = session::BasePoseMessage(finger.base_from_tip);
  measured.set_touch_id(touch.id);
  measured.set_session(session);
  measured.set_speed_m_s(result.speed_m_s);
  measured.set_session_time_s(result.session_time_s);
  measured.set_start_unix_s(result.start_unix_s);
  measured.set_time_uncertainty_s(result.time_uncertainty_s);
  measured.set_synchronisation_uncertainty_s(result.synchronisation_uncertainty_s);
  measured.set_effector_drift(result.effector_drift);
  measured.set_recovered(result.recovered);
  return measured;
}

}  // namespace

v1::DescribeResponse ToProto(const source::SourceInfo& info, const Limits& limits) {
  v1::DescribeResponse message;
  message.set_kind(info.kind == source::SourceKind::kPhysical ? v1::SOURCE_KIND_PHYSICAL
                                                              : v1::SOURCE_KIND_VIRTUAL);
  message.set_version(kVersion);
  for (const touch::Plan::Kind plan : info.plans) message.add_plans(PlanName(plan));
  if (info.default_model != nullptr) {
    message.set_default_model(info.default_model->name);
    message.set_default_model_hash(info.default_model->Hash());
  }
  message.set_renderer(RendererKindOf(info.renderer));
  message.set_renderer_description(info.renderer_description);
  message.set_max_touches_per_request(limits.max_touches_per_request);
  message.set_max_images_per_request(info.makes_images ? limits.max_images_per_request : 0);
  message.set_max_image_side(info.makes_images ? image::kMaxImageSide : 0);
  message.set_max_batch_size(limits.max_batch_size);
  message.set_max_indices_per_request(limits.max_indices_per_request);
  message.set_max_fingers(info.max_fingers);
  message.set_lease_required(info.moves);
  message.set_touch_duration_s(info.touch_duration_s);
  message.set_clock_uncertainty_s(info.clock_uncertainty_s);
  for (const LimitRow& row : LimitTable()) {
    v1::Limit* limit = message.add_limits();
    limit->set_name(row.name);
    limit->set_value(row.Value(limits));
    limit->set_unit(row.unit);
    limit->set_meaning(row.meaning);
  }
  return message;
}

v1::ListObjectsResponse ToProto(const source::ObjectStore& objects) {
  v1::ListObjectsResponse message;
  for (const auto& [name, served] : objects.all()) {
    v1::Object* object = message.add_objects();
    object->set_name(name);
    object->set_vertices(served.surface->mesh().vertices_m.size());
    object->set_triangles(served.surface->mesh().triangles.size());
    *object->mutable_bounds_min_m() = ToProto(served.surface->bounds().min_m);
    *object->mutable_bounds_max_m() = ToProto(served.surface->bounds().max_m);
    object->set_closed(served.closed);
    object->set_mesh_hash(served.surface->hash());
    object->set_origin(served.origin);
  }
  return message;
}

v1::ExpandPlanResponse ToProto(const source::ExpandedPlan& plan) {
  v1::ExpandPlanResponse message;
  for (const touch::CommandedTouch& touch : plan.touches) *message.add_touches() = ToProto(touch);
  for (const std::string& note : plan.notes) message.add_notes(note);
  if (plan.draws.Draws() == 0) return message;
  v1::PlanDraws* draws = message.mutable_draws();
  draws->set_draws(plan.draws.Draws());
  draws->set_no_surface(plan.draws.Of(touch::DrawFlaw::kNoSurface));
  draws->set_start_blocked(plan.draws.Of(touch::DrawFlaw::kStartBlocked));
  draws->set_finger_missed(plan.draws.Of(touch::DrawFlaw::kFingerMissed));
  draws->set_beyond_stroke(plan.draws.Of(touch::DrawFlaw::kBeyondStroke));
  draws->set_steep_incidence(plan.draws.Of(touch::DrawFlaw::kSteepIncidence));
  return message;
}

v1::TouchResponse ToProto(const source::TouchResults& results) {
  v1::TouchResponse message;
  for (const std::string& note : results.notes) message.add_notes(note);
  if (results.model != nullptr) message.set_model_hash(results.model->Hash());
  for (size_t touch = 0; touch < results.size(); ++touch) {
    v1::TouchResult* result = message.add_results();
    const size_t first = touch * results.fingers;
    result->set_complete(
        touch::ForDescriptor(results.contact_time_s.data() + first, 1, results.fingers,
                             [result](int, double relative_s) { result->add_descriptor_s(relative_s); }));
    for (size_t k = first; k < first + results.fingers; ++k) {
      result->add_contact_time_s(results.contact_time_s[k]);
      if (!results.travel_m.empty()) result->add_travel_m(results.travel_m[k]);
      for (int i = 0; i < 3 && !results.contact_m.empty(); ++i) {
        result->add_contact_point_m(results.contact_m[k][i]);
        result->add_normal(results.normal[k][i]);
      }
    }
    if (!results.journalled.empty())
      *result->mutable_measured() = MeasuredToProto(results.journalled[touch], results.session);
    if (touch < results.series.size() && results.series[touch].has_value())
      result->mutable_measured()->mutable_series()->ParseFromString(results.series[touch]->columns);
  }
  return message;
}

v1::CaptureResponse ToProto(source::CaptureResults results) {
  v1::CaptureResponse message;
  v1::Batch batch = ToProto(std::move(results.batch), results.columns);
  message.set_rows(batch.rows());
  message.mutable_columns()->Swap(batch.mutable_columns());
  for (const source::PhotographPose& pose : results.photographs) {
    v1::Photograph* photograph = message.add_photographs();
    photograph->set_unix_s(pose.unix_s);
    photograph->set_deviation_m(pose.deviation_m);
    photograph->set_deviation_rad(pose.deviation_rad);
    if (!pose.measured.has_value()) continue;
    *photograph->mutable_measured()->mutable_eye_m() = ToProto(pose.measured->eye_m);
    *photograph->mutable_measured()->mutable_at_m() = ToProto(pose.measured->at_m);
    *photograph->mutable_measured()->mutable_up() = ToProto(pose.measured->up);
  }
  return message;
}

v1::DatasetHeader ToProto(const source::SampleHeader& header) {
  v1::DatasetHeader message;
  message.set_samples(header.samples);
  if (header.model != nullptr) {
    message.set_model_name(header.model->name);
    message.set_model_hash(header.model->Hash());
    message.set_model_yaml(model::FormatModel(*header.model));
  }
  for (const std::string& hash : header.mesh_hashes) message.add_mesh_hashes(hash);
  message.set_fingers(header.fingers);
  message.set_spacing_m(header.spacing_m);
  for (const dataset::ColumnInfo& column : header.columns) *message.add_columns() = ColumnToProto(column);
  message.set_renderer(RendererKindOf(header.renderer));
  message.set_version(kVersion);
  return message;
}

v1::Batch ToProto(dataset::DatasetBatch batch, const std::vector<dataset::ColumnInfo>& columns) {
  v1::Batch message;
  message.set_start_index(batch.start_index);
  message.set_rows(batch.rows);
  message.set_draws(batch.draws);
  for (size_t k = 0; k < columns.size(); ++k) {
    v1::Column* column = message.add_columns();
    *column = ColumnToProto(columns[k]);
    column->set_data(std::move(batch.data[k]));
    column->mutable_offsets()->Add(batch.offsets[k].begin(), batch.offsets[k].end());
  }
  return message;
}

}  // namespace touchstone::service
