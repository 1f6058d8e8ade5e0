// Messages of touchstone.v1.Source to the requests of a source.
#include <absl/strings/str_cat.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <limits>
#include <set>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/base/text/text.h"
#include "server/service/calls/source_messages.h"
#include "server/service/core/convert.h"
#include "server/uncertainty/posterior_message.h"

namespace touchstone::service {
namespace {

constexpr int kMaxPrevious = 2;

// Of a field that 0 leaves as it is. What an int does not hold is refused here, as it was sent.
absl::Status SetIfGiven(uint32_t sent, absl::string_view field, int* value) {
  constexpr int kMax = std::numeric_limits<int>::max();
  if (sent > static_cast<uint32_t>(kMax))
    return absl::InvalidArgumentError(absl::StrCat(field, " = ", sent, ": must be at most ", kMax));
  if (sent != 0) *value = static_cast<int>(sent);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<image::Camera> FromProto(const v1::View& view, const std::string& where) {
  switch (view.view_case()) {
    case v1::View::kTouch: {
      TOUCHSTONE_ASSIGN_OR_RETURN(const touch::CommandedTouch touch,
                                  FromProto(view.touch(), where + ".touch"));
      return image::CameraOfTouch(touch.target_m, touch.approach, touch.lateral, touch.standoff_m);
    }
    case v1::View::kCamera: {
      image::Camera camera;
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

absl::StatusOr<touch::Plan> FromProto(const v1::Plan& message) {
  touch::Plan plan;
  if (message.speed_m_s() != 0) plan.speed_m_s = message.speed_m_s();
  plan.touch_interval_s = message.touch_interval_s();
  switch (message.plan_case()) {
    case v1::Plan::kSphere: {
      plan.kind = touch::Plan::Kind::kSphere;
      const v1::SpherePlan& sphere = message.sphere();
      if (sphere.step_angle_rad() != 0) plan.sphere.step_angle_rad = sphere.step_angle_rad();
      plan.sphere.roll_step_rad = sphere.roll_step_rad();
      if (sphere.radius_ratio() != 0) plan.sphere.radius_ratio = sphere.radius_ratio();
      if (sphere.has_max_incidence_rad()) plan.sphere.max_incidence_rad = sphere.max_incidence_rad();
      break;
    }
    case v1::Plan::kFaces: {
      plan.kind = touch::Plan::Kind::kFaces;
      const v1::FacesPlan& faces = message.faces();
      TOUCHSTONE_RETURN_IF_ERROR(
          SetIfGiven(faces.samples_per_face(), "plan.faces.samples_per_face", &plan.faces.samples_per_face));
      TOUCHSTONE_RETURN_IF_ERROR(SetIfGiven(faces.rounds(), "plan.faces.rounds", &plan.faces.rounds));
      if (faces.has_max_tilt_rad()) plan.faces.max_tilt_rad = faces.max_tilt_rad();
      if (faces.has_spread()) plan.faces.spread = faces.spread();
      if (faces.standoff_m() != 0) plan.faces.standoff_m = faces.standoff_m();
      if (faces.has_max_incidence_rad()) plan.faces.max_incidence_rad = faces.max_incidence_rad();
      if (faces.stroke_beyond_target_m() != 0)
        plan.faces.stroke_beyond_target_m = faces.stroke_beyond_target_m();
      break;
    }
    case v1::Plan::kList: {
      plan.kind = touch::Plan::Kind::kList;
      for (int k = 0; k < message.list().touches_size(); ++k) {
        TOUCHSTONE_ASSIGN_OR_RETURN(
            touch::CommandedTouch touch,
            FromProto(message.list().touches(k), absl::StrCat("plan.list.touches[", k, "]")));
        plan.list.push_back(std::move(touch));
      }
      break;
    }
    case v1::Plan::PLAN_NOT_SET:
      return absl::InvalidArgumentError("plan is missing: set plan.sphere, plan.faces or plan.list");
  }
  TOUCHSTONE_RETURN_IF_ERROR(touch::ValidatePlan(&plan));
  return plan;
}

absl::StatusOr<dataset::DatasetImage> FromProto(const v1::ImageSpec& message) {
  dataset::DatasetImage image;
  image.options.width = image.options.height = 224;
  TOUCHSTONE_RETURN_IF_ERROR(SetIfGiven(message.width(), "image.width", &image.options.width));
  TOUCHSTONE_RETURN_IF_ERROR(SetIfGiven(message.height(), "image.height", &image.options.height));
  image.options.format =
      message.format() == v1::PIXEL_FORMAT_RGB ? image::PixelFormat::kRgb : image::PixelFormat::kGrey;
  image.options.shading_style = message.shading_style() == v1::SHADING_STYLE_DARK_ON_WHITE
                                    ? image::ShadingStyle::kDarkOnWhite
                                    : image::ShadingStyle::kShaded;
  image.options.depth = message.depth();
  image.options.mask = message.mask();
  image.encoding = message.encoding() == v1::IMAGE_ENCODING_PNG    ? dataset::ImageEncoding::kPng
                   : message.encoding() == v1::IMAGE_ENCODING_JPEG ? dataset::ImageEncoding::kJpeg
                                                                   : dataset::ImageEncoding::kRaw;
  TOUCHSTONE_RETURN_IF_ERROR(SetIfGiven(message.jpeg_quality(), "image.jpeg_quality", &image.jpeg_quality));
  image.normalize = message.normalize();
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
  image.renderer_kind = message.renderer() == v1::RENDERER_KIND_EGL   ? image::RendererKind::kEgl
                        : message.renderer() == v1::RENDERER_KIND_CPU ? image::RendererKind::kCpu
                                                                      : image::RendererKind::kAuto;
  return image;
}

namespace {

// Of a plan and its draws. Finer angles and more draws cost memory and time, whatever comes of them.
absl::Status CheckPlanLimits(const touch::Plan& plan, uint32_t max_draws, const Limits& limits) {
  if (plan.kind == touch::Plan::Kind::kList)
    TOUCHSTONE_RETURN_IF_ERROR(source::CheckTouchCount(plan.list.size(), limits.OfSource()));
  if (plan.kind == touch::Plan::Kind::kSphere)
    for (const auto& [step_rad, name] : {std::pair(plan.sphere.step_angle_rad, "step_angle_rad"),
                                         std::pair(plan.sphere.roll_step_rad, "roll_step_rad")})
      if (step_rad != 0 && step_rad < limits.min_step_angle_rad)
        return absl::ResourceExhaustedError(
            absl::StrCat("plan.sphere.", name, " = ", ShortestNumber(step_rad), ": at least ",
                         ShortestNumber(limits.min_step_angle_rad), " (min_step_angle_rad)"));
  TOUCHSTONE_RETURN_IF_ERROR(dataset::CheckMaxDraws(max_draws));
  if (max_draws > static_cast<uint32_t>(limits.max_draws))
    return OverLimit("max_draws =", max_draws, "max_draws", limits.max_draws);
  return absl::OkStatus();
}

absl::Status CheckObjects(const google::protobuf::RepeatedPtrField<std::string>& objects,
                          const Limits& limits) {
  const std::set<absl::string_view> distinct(objects.begin(), objects.end());
  if (distinct.size() <= static_cast<size_t>(limits.max_objects)) return absl::OkStatus();
  return OverLimit("objects has distinct names:", distinct.size(), "max_objects", limits.max_objects);
}

// A rig simulates nothing: the model that a request names is not looked up there.
bool Simulates(const Resources& resources) {
  return resources.default_model != nullptr;
}

// What decides the touches of a dataset (objects, plan, seed), as 16 hexadecimal digits; columns and images do not.
std::string DatasetKey(const v1::DatasetSpec& spec) {
  v1::DatasetSpec decisive;
  *decisive.mutable_objects() = spec.objects();
  *decisive.mutable_plan() = spec.plan();
  decisive.set_seed(spec.seed());
  // Maps in the order of their keys: equal specifications, equal bytes.
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    decisive.SerializeToCodedStream(&coded);
  }
  return Sha256Hex(bytes).substr(0, 16);
}

}  // namespace

absl::StatusOr<source::PlanRequest> FromProto(const v1::ExpandPlanRequest& message,
                                              const Resources& resources) {
  source::PlanRequest request;
  TOUCHSTONE_ASSIGN_OR_RETURN(request.plan, FromProto(message.plan()));
  request.object = message.object();
  request.seed = message.seed();
  request.first_index = message.first_index();
  request.count = message.count();
  if (message.max_draws() != 0) request.max_draws = message.max_draws();
  TOUCHSTONE_RETURN_IF_ERROR(CheckPlanLimits(request.plan, request.max_draws, resources.options));
  if (!message.has_model() || message.model().ref_case() == v1::ModelRef::REF_NOT_SET) return request;
  // A rig keeps no models, but where its fingers would be can be asked of a whole file.
  if (!Simulates(resources) && !message.model().has_yaml())
    return absl::InvalidArgumentError("model: this source keeps no models; give the model's file");
  TOUCHSTONE_ASSIGN_OR_RETURN(request.model, FromProto(message.model(), resources));
  return request;
}

absl::StatusOr<source::TouchRequest> FromProto(const v1::TouchRequest& message, const Resources& resources) {
  source::TouchRequest request;
  request.object = message.object();
  if (message.has_model() && Simulates(resources)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(request.model, FromProto(message.model(), resources));
  }
  // Counted before they are taken apart: what is too much must cost nothing.
  TOUCHSTONE_RETURN_IF_ERROR(source::CheckTouchCount(message.touches_size(), resources.options.OfSource()));
  for (int k = 0; k < message.touches_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(touch::CommandedTouch touch,
                                FromProto(message.touches(k), absl::StrCat("touches[", k, "]")));
    request.touches.push_back(std::move(touch));
  }
  request.seed = message.seed();
  request.first_index = message.first_index();
  request.session = message.session();
  request.ids.assign(message.touch_ids().begin(), message.touch_ids().end());
  request.series = message.series();
  if (message.previous_size() > kMaxPrevious)
    return absl::InvalidArgumentError(absl::StrCat("previous has ", message.previous_size(),
                                                   " touches: at most ", kMaxPrevious,
                                                   ", the last ones, act on what follows"));
  for (int k = 0; k < message.previous_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        touch::CommandedTouch touch,
        FromProto(message.previous(k).touch(), absl::StrCat("previous[", k, "].touch")));
    request.previous.push_back({message.previous(k).object(), std::move(touch)});
  }
  return request;
}

absl::StatusOr<source::CaptureRequest> FromProto(const v1::CaptureRequest& message,
                                                 const Resources& resources) {
  source::CaptureRequest request;
  request.object = message.object();
  TOUCHSTONE_ASSIGN_OR_RETURN(request.image, FromProto(message.image()));
  for (int k = 0; k < message.views_size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(image::Camera camera,
                                FromProto(message.views(k), absl::StrCat("views[", k, "]")));
    camera.vertical_fov_rad = request.image.vertical_fov_rad;
    request.cameras.push_back(camera);
  }
  if (message.has_model() && Simulates(resources)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(request.model, FromProto(message.model(), resources));
  }
  request.seed = message.seed();
  request.first_index = message.first_index();
  return request;
}

absl::StatusOr<source::SampleRequest> FromProto(const v1::StreamDatasetRequest& message,
                                                const Resources& resources) {
  const v1::DatasetSpec& spec = message.spec();
  source::SampleRequest request;
  TOUCHSTONE_RETURN_IF_ERROR(CheckObjects(spec.objects(), resources.options));
  request.objects.assign(spec.objects().begin(), spec.objects().end());
  dataset::DatasetSpecification& specification = request.specification;
  TOUCHSTONE_ASSIGN_OR_RETURN(specification.plan, FromProto(spec.plan()));
  // Where none is named, a posterior brings its own.
  const bool names_model = spec.model().ref_case() != v1::ModelRef::REF_NOT_SET;
  if (spec.has_model() && Simulates(resources) && (names_model || !spec.has_posterior())) {
    TOUCHSTONE_ASSIGN_OR_RETURN(specification.model, FromProto(spec.model(), resources));
  }
  if (!Simulates(resources) && (spec.has_posterior() || spec.draw_models()))
    return absl::InvalidArgumentError(
        "posterior: a rig touches with what it is, not with a model that is drawn; leave posterior and "
        "draw_models out");
  if (spec.has_posterior()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(uncertainty::Posterior posterior, uncertainty::FromMessage(spec.posterior()));
    if (specification.model == nullptr)
      specification.model = std::make_shared<const model::Model>(posterior.model);
    specification.posterior = std::make_shared<const uncertainty::Posterior>(std::move(posterior));
  }
  specification.draw_models = spec.draw_models();
  specification.seed = spec.seed();
  specification.samples = spec.samples();
  TOUCHSTONE_ASSIGN_OR_RETURN(specification.columns, dataset::ColumnChoice::FromNames(
                                                         {spec.columns().begin(), spec.columns().end()}));
  if (specification.columns.image) {
    TOUCHSTONE_ASSIGN_OR_RETURN(specification.image, FromProto(spec.image()));
  }
  if (spec.max_draws() != 0) specification.max_draws = spec.max_draws();
  TOUCHSTONE_RETURN_IF_ERROR(CheckPlanLimits(specification.plan, specification.max_draws, resources.options));
  request.part.start_index = message.start_index();
  request.part.stop_index = message.stop_index();
  request.part.batch_size = message.batch_size();
  request.part.batch_stride = message.batch_stride();
  request.part.indices.assign(message.indices().begin(), message.indices().end());
  request.session = message.session();
  request.key = DatasetKey(spec);
  return request;
}

}  // namespace touchstone::service
