#include "server/service/convert.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/effects/all_effects.h"

namespace touchstone {

grpc::Status ToGrpc(const absl::Status& status) {
  // The two enumerations share their numbers.
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()));
}

v1::Vector3 ToProto(const Eigen::Vector3d& v) {
  v1::Vector3 message;
  message.set_x(v.x()), message.set_y(v.y()), message.set_z(v.z());
  return message;
}

Eigen::Vector3d FromProto(const v1::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

absl::StatusOr<CommandedTouch> FromProto(const v1::CommandedTouch& message, const std::string& where) {
  for (const auto& [present, name] :
       {std::pair(message.has_target_m(), "target_m"), std::pair(message.has_approach(), "approach"),
        std::pair(message.has_lateral(), "lateral")})
    if (!present)
      return absl::InvalidArgumentError(absl::StrCat(where, ".", name, " is missing: a touch needs it"));
  CommandedTouch touch;
  touch.target_m = FromProto(message.target_m());
  touch.approach = FromProto(message.approach());
  touch.lateral = FromProto(message.lateral());
  touch.standoff_m = message.standoff_m();
  touch.speed_m_s = message.speed_m_s();
  if (message.has_stroke_m()) touch.stroke_m = message.stroke_m();
  if (message.has_session_time_s()) touch.session_time_s = message.session_time_s();
  touch.covariates.insert(message.covariates().begin(), message.covariates().end());
  TOUCHSTONE_RETURN_IF_ERROR(MakeExact(&touch, where));
  return touch;
}

v1::CommandedTouch ToProto(const CommandedTouch& touch) {
  v1::CommandedTouch message;
  *message.mutable_target_m() = ToProto(touch.target_m);
  *message.mutable_approach() = ToProto(touch.approach);
  *message.mutable_lateral() = ToProto(touch.lateral);
  message.set_standoff_m(touch.standoff_m);
  message.set_speed_m_s(touch.speed_m_s);
  if (touch.stroke_m < kNoStrokeLimitM) message.set_stroke_m(touch.stroke_m);
  message.set_session_time_s(touch.session_time_s);
  message.mutable_covariates()->insert(touch.covariates.begin(), touch.covariates.end());
  return message;
}

absl::Status CheckTouchIds(const v1::TouchRequest& request) {
  constexpr size_t kMaxIdBytes = 128;
  if (request.touch_ids_size() == 0) return absl::OkStatus();
  if (request.touch_ids_size() != request.touches_size())
    return absl::InvalidArgumentError(absl::StrCat("touch_ids has ", request.touch_ids_size(),
                                                   ": give none, or one for each of the ",
                                                   request.touches_size(), " touches"));
  for (int k = 0; k < request.touch_ids_size(); ++k)
    if (request.touch_ids(k).empty() || request.touch_ids(k).size() > kMaxIdBytes)
      return absl::InvalidArgumentError(
          absl::StrCat("touch_ids[", k, "] has ", request.touch_ids(k).size(), " bytes: 1 to ", kMaxIdBytes));
  return absl::OkStatus();
}

absl::StatusOr<Camera> FromProto(const v1::View& view, const std::string& where) {
  switch (view.view_case()) {
    case v1::View::kTouch: {
      TOUCHSTONE_ASSIGN_OR_RETURN(const CommandedTouch touch, FromProto(view.touch(), where + ".touch"));
      return CameraOfTouch(touch.target_m, touch.approach, touch.lateral, touch.standoff_m);
    }
    case v1::View::kCamera: {
      Camera camera;
      camera.eye_m = FromProto(view.camera().eye_m());
      camera.at_m = FromProto(view.camera().at_m());
      camera.up = FromProto(view.camera().up());
      camera.near_m = view.camera().near_m();
      camera.far_m = view.camera().far_m();
      return camera;
    }
    case v1::View::VIEW_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError(absl::StrCat(where, " is empty: set touch or camera"));
}

absl::StatusOr<Plan> FromProto(const v1::Plan& message) {
  Plan plan;
  if (message.speed_m_s() != 0) plan.speed_m_s = message.speed_m_s();
  plan.touch_interval_s = message.touch_interval_s();
  switch (message.plan_case()) {
    case v1::Plan::kSphere: {
      plan.kind = Plan::Kind::kSphere;
      const v1::SpherePlan& sphere = message.sphere();
      if (sphere.step_angle_rad() != 0) plan.sphere.step_angle_rad = sphere.step_angle_rad();
      plan.sphere.roll_step_rad = sphere.roll_step_rad();
      if (sphere.radius_ratio() != 0) plan.sphere.radius_ratio = sphere.radius_ratio();
      break;
    }
    case v1::Plan::kFaces: {
      plan.kind = Plan::Kind::kFaces;
      const v1::FacesPlan& faces = message.faces();
      constexpr uint32_t kMax = 1'000'000;  // beyond, the plan's check refuses, whatever the number
      if (faces.samples_per_face() != 0)
        plan.faces.samples_per_face = std::min(faces.samples_per_face(), kMax + 1);
      if (faces.rounds() != 0) plan.faces.rounds = std::min(faces.rounds(), kMax + 1);
      if (faces.has_max_tilt_rad()) plan.faces.max_tilt_rad = faces.max_tilt_rad();
      if (faces.has_spread()) plan.faces.spread = faces.spread();
      if (faces.standoff_m() != 0) plan.faces.standoff_m = faces.standoff_m();
      break;
    }
    case v1::Plan::kList: {
      plan.kind = Plan::Kind::kList;
      for (int k = 0; k < message.list().touches_size(); ++k) {
        TOUCHSTONE_ASSIGN_OR_RETURN(
            CommandedTouch touch,
            FromProto(message.list().touches(k), absl::StrCat("plan.list.touches[", k, "]")));
        plan.list.push_back(std::move(touch));
      }
      break;
    }
    case v1::Plan::PLAN_NOT_SET:
      return absl::InvalidArgumentError("plan is missing: set plan.sphere, plan.faces or plan.list");
  }
  TOUCHSTONE_RETURN_IF_ERROR(ValidatePlan(&plan));
  return plan;
}

absl::StatusOr<std::shared_ptr<const Model>> FromProto(const v1::ModelRef& message,
                                                       const Resources& resources) {
  switch (message.ref_case()) {
    case v1::ModelRef::kName:
      return resources.models->FindByName(message.name());
    case v1::ModelRef::kHash:
      return resources.models->FindByHash(message.hash());
    case v1::ModelRef::kYaml: {
      TOUCHSTONE_ASSIGN_OR_RETURN(Model model, ParseModel(message.yaml(), "model.yaml", Catalogue()));
      return std::make_shared<const Model>(std::move(model));
    }
    case v1::ModelRef::REF_NOT_SET:
      break;
  }
  return resources.default_model;
}

absl::StatusOr<DatasetImage> FromProto(const v1::ImageSpec& message, Resources* resources) {
  DatasetImage image;
  // Out-of-range numbers reach the check as what they are: no wrap-around.
  const auto side = [](uint32_t value) {
    return value == 0 ? 224 : static_cast<int>(std::min<uint32_t>(value, 1u << 30));
  };
  image.options.width = side(message.width());
  image.options.height = side(message.height());
  image.options.format = message.format() == v1::PIXEL_FORMAT_RGB ? PixelFormat::kRgb : PixelFormat::kGrey;
  image.options.shading_style = message.shading_style() == v1::SHADING_STYLE_DARK_ON_WHITE
                                    ? ShadingStyle::kDarkOnWhite
                                    : ShadingStyle::kShaded;
  image.options.depth = message.depth();
  image.options.mask = message.mask();
  image.encoding = message.encoding() == v1::IMAGE_ENCODING_PNG    ? ImageEncoding::kPng
                   : message.encoding() == v1::IMAGE_ENCODING_JPEG ? ImageEncoding::kJpeg
                                                                   : ImageEncoding::kRaw;
  if (message.jpeg_quality() != 0)
    image.jpeg_quality = static_cast<int>(std::min<uint32_t>(message.jpeg_quality(), 1000));
  if (message.vertical_fov_rad() != 0) image.vertical_fov_rad = message.vertical_fov_rad();
  for (const auto& [value, valid, name] :
       {std::tuple<int, bool, const char*>(message.format(), v1::PixelFormat_IsValid(message.format()),
                                           "format"),
        {message.encoding(), v1::ImageEncoding_IsValid(message.encoding()), "encoding"},
        {message.shading_style(), v1::ShadingStyle_IsValid(message.shading_style()), "shading_style"},
        {message.renderer(), v1::RendererKind_IsValid(message.renderer()), "renderer"}})
    if (!valid)
      return absl::InvalidArgumentError(
          absl::StrCat("image.", name, " = ", value, ": is no value of its enumeration"));
  const RendererKind kind = message.renderer() == v1::RENDERER_KIND_EGL   ? RendererKind::kEgl
                            : message.renderer() == v1::RENDERER_KIND_CPU ? RendererKind::kCpu
                                                                          : RendererKind::kAuto;
  TOUCHSTONE_ASSIGN_OR_RETURN(image.renderer, resources->RendererFor(kind));
  return image;
}

absl::StatusOr<std::shared_ptr<const DatasetSpecification>> FromProto(const v1::DatasetSpec& message,
                                                                      Resources* resources) {
  auto specification = std::make_shared<DatasetSpecification>();
  for (int k = 0; k < message.objects_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const ServedObject* object,
        resources->objects.Find(message.objects(k), absl::StrCat("spec.objects[", k, "]")));
    specification->objects.push_back(object->surface);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(specification->plan, FromProto(message.plan()));
  TOUCHSTONE_ASSIGN_OR_RETURN(specification->model, FromProto(message.model(), *resources));
  specification->seed = message.seed();
  specification->samples = message.samples();
  TOUCHSTONE_ASSIGN_OR_RETURN(specification->columns,
                              ColumnChoice::FromNames({message.columns().begin(), message.columns().end()}));
  if (specification->columns.image) {
    TOUCHSTONE_ASSIGN_OR_RETURN(specification->image, FromProto(message.image(), resources));
  }
  if (message.max_draws() != 0) specification->max_draws = message.max_draws();
  TOUCHSTONE_RETURN_IF_ERROR(ValidateDataset(specification.get()));
  return specification;
}

v1::RendererKind RendererKindOf(const Renderer& renderer) {
  return renderer.name() == "egl" ? v1::RENDERER_KIND_EGL : v1::RENDERER_KIND_CPU;
}

v1::Column ColumnToProto(const ColumnInfo& info) {
  v1::Column column;
  column.set_name(info.name);
  switch (info.type) {
    case ColumnType::kFloat32:
      column.set_type(v1::DATA_TYPE_FLOAT32);
      break;
    case ColumnType::kUint8:
      column.set_type(v1::DATA_TYPE_UINT8);
      break;
    case ColumnType::kInt32:
      column.set_type(v1::DATA_TYPE_INT32);
      break;
    case ColumnType::kUint64:
      column.set_type(v1::DATA_TYPE_UINT64);
      break;
    case ColumnType::kBytes:
      column.set_type(v1::DATA_TYPE_BYTES);
      break;
  }
  column.mutable_shape()->Add(info.shape.begin(), info.shape.end());
  return column;
}

v1::DatasetHeader HeaderOf(const DatasetSpecification& specification) {
  v1::DatasetHeader header;
  header.set_samples(specification.samples);
  header.set_model_name(specification.model->name);
  header.set_model_hash(specification.model->Hash());
  header.set_model_yaml(FormatModel(*specification.model));
  for (const auto& object : specification.objects) header.add_mesh_hashes(object->hash());
  header.set_fingers(specification.model->fingers);
  header.set_spacing_m(specification.model->spacing_m);
  for (const ColumnInfo& column : ColumnsOf(specification)) *header.add_columns() = ColumnToProto(column);
  if (specification.columns.image) header.set_renderer(RendererKindOf(*specification.image.renderer));
  header.set_version(kVersion);
  return header;
}

v1::Batch ToProto(DatasetBatch batch, const std::vector<ColumnInfo>& columns) {
  v1::Batch message;
  message.set_start_index(batch.start_index);
  message.set_rows(batch.rows);
  for (size_t k = 0; k < columns.size(); ++k) {
    v1::Column* column = message.add_columns();
    *column = ColumnToProto(columns[k]);
    column->set_data(std::move(batch.data[k]));
    column->mutable_offsets()->Add(batch.offsets[k].begin(), batch.offsets[k].end());
  }
  return message;
}

namespace {

v1::EffectStage ToProto(Stage stage) {
  switch (stage) {
    case Stage::kPose:
      return v1::EFFECT_STAGE_POSE;
    case Stage::kContact:
      return v1::EFFECT_STAGE_CONTACT;
    case Stage::kMotion:
      return v1::EFFECT_STAGE_MOTION;
    case Stage::kSensor:
      return v1::EFFECT_STAGE_SENSOR;
  }
  return v1::EFFECT_STAGE_UNSPECIFIED;
}

v1::ParameterArity ToProto(Arity arity) {
  switch (arity) {
    case Arity::kScalar:
      return v1::PARAMETER_ARITY_SCALAR;
    case Arity::kVector3:
      return v1::PARAMETER_ARITY_VECTOR3;
    case Arity::kPerFinger:
      return v1::PARAMETER_ARITY_PER_FINGER;
  }
  return v1::PARAMETER_ARITY_UNSPECIFIED;
}

}  // namespace

v1::Effect ToProto(const Effect& effect) {
  v1::Effect message;
  message.set_name(effect.name);
  message.set_stage(ToProto(effect.stage));
  message.set_meaning(effect.meaning);
  message.set_signature(effect.signature);
  message.set_check_on_rig(effect.check_on_rig);
  message.set_remedy(effect.remedy);
  for (const ParameterInfo& info : effect.parameters) {
    v1::Parameter* parameter = message.add_parameters();
    parameter->set_name(info.name);
    parameter->set_unit(std::string(UnitSymbol(info.unit)));
    parameter->set_arity(ToProto(info.arity));
    parameter->set_min(info.lower);
    parameter->set_max(info.upper);
    parameter->set_default_value(info.neutral);
    parameter->set_typical(info.typical);
    parameter->set_sum_zero(info.sum_zero);
    parameter->set_meaning(info.meaning);
  }
  return message;
}

v1::Model ToProto(const Model& model) {
  v1::Model message;
  message.set_name(model.name);
  message.set_hash(model.Hash());
  message.set_yaml(FormatModel(model));
  message.set_fingers(model.fingers);
  message.set_spacing_m(model.spacing_m);
  return message;
}

}  // namespace touchstone
