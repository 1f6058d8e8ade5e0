#include "client/cli/options/plan_options.h"

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"
#include "server/base/units.h"
#include "server/service/core/convert.h"
#include "server/session/images/images_csv.h"

namespace touchstone::cli {
namespace {

constexpr char kPlanGroup[] = "Plan";
constexpr char kImageGroup[] = "Image";
constexpr uint64_t kMaxPlanBytes = 1 << 30;

// The generators' defaults (source.proto), in the units of files.
constexpr double kStepAngleDeg = 1;
constexpr double kRadiusRatio = 1.05;
constexpr double kRadiusRatioOfPictures = 2.4;  // that client/training uses: at 45 deg the whole object shows
// Half the height that a picture shows at the target, over half the box's diagonal: below it the object mostly fills the frame.
constexpr double kMinShownShare = 0.75;
constexpr uint32_t kSamplesPerFace = 8;
constexpr uint32_t kRounds = 4;
constexpr double kMaxTiltDeg = 20;
constexpr double kSpread = 0.6;
constexpr double kStandoffMm = 60;
constexpr double kStrokeBeyondTargetMm = kDefaultStrokeBeyondTargetM * kMillimetresPerMetre;
constexpr double kSphereMaxIncidenceDeg = 90;
constexpr double kFacesMaxIncidenceDeg = 60;
constexpr double kSpeedMmS = 20;

}  // namespace

void AddPlanOptions(Cli* cli, CLI::App* command, PlanOptions* options) {
  const auto add = [&](const std::string& name, auto& value, const std::string& type,
                       const std::string& text) {
    return command->add_option(name, value, text)->type_name(type)->group(kPlanGroup);
  };
  cli->AddInput(
      command, add("--plan", options->plan, "PLAN",
                   "sphere: random directions round the object; faces: rounds of poses from the six faces of "
                   "its box onto its surface; either draws a touch again until every finger meets the "
                   "object; or a CSV file of explicit touches (touchstone plan writes one). "
                   "Default: sphere"));
  add("--speed-mm-s", options->speed_mm_s, "MM/S", "Speed of the approach. Default: 20; a file has its own");
  add("--touch-interval-s", options->touch_interval_s, "S",
      "Time between the starts of touches, over all objects. Default: 0");
  add("--step-angle-deg", options->step_angle_deg, "DEG",
      "sphere: directions are multiples of it. Default: 1");
  add("--roll-step-deg", options->roll_step_deg, "DEG",
      "sphere: the fingers' row is turned by random multiples of it. Default: 0, not turned");
  add("--radius-ratio", options->radius_ratio, "RATIO",
      "sphere: radius of the start sphere over half the box's diagonal. Default: 1.05; of a "
      "stream with pictures 2.4, from where the whole object shows");
  add("--samples-per-face", options->samples_per_face, "N", "faces: poses per face. Default: 8");
  add("--rounds", options->rounds, "N", "faces: repeats of all poses. Default: 4");
  add("--max-tilt-deg", options->max_tilt_deg, "DEG",
      "faces: largest angle to the face's normal. Default: 20");
  add("--spread", options->spread, "RATIO", "faces: lines go through this share of a face. Default: 0.6");
  add("--standoff-mm", options->standoff_mm, "MM",
      "faces: distance of the start from the target. Default: 60");
  add("--stroke-beyond-target-mm", options->stroke_beyond_target_mm, "MM",
      "faces: every finger meets the object before it is so far behind the target, where a rig's approach "
      "ends. Default: 30");
  add("--max-incidence-deg", options->max_incidence_deg, "DEG",
      "sphere, faces: largest angle at which a finger meets the surface, 0 being square on; 90: any. "
      "Default: 60 for faces, 90 for sphere");
}

absl::StatusOr<v1::Plan> MakePlan(const PlanOptions& o, std::vector<std::string>* objects) {
  // An option that does nothing is a mistake, and refused.
  const std::pair<const char*, bool> sphere_only[] = {{"--step-angle-deg", o.step_angle_deg.has_value()},
                                                      {"--roll-step-deg", o.roll_step_deg.has_value()},
                                                      {"--radius-ratio", o.radius_ratio.has_value()}};
  const std::pair<const char*, bool> faces_only[] = {
      {"--samples-per-face", o.samples_per_face.has_value()},
      {"--rounds", o.rounds.has_value()},
      {"--max-tilt-deg", o.max_tilt_deg.has_value()},
      {"--spread", o.spread.has_value()},
      {"--standoff-mm", o.standoff_mm.has_value()},
      {"--stroke-beyond-target-mm", o.stroke_beyond_target_mm.has_value()}};
  const std::pair<const char*, bool> not_in_list[] = {
      {"--max-incidence-deg", o.max_incidence_deg.has_value()},
      {"--speed-mm-s", o.speed_mm_s.has_value()},
      {"--touch-interval-s", o.touch_interval_s.has_value()}};
  const auto misplaced = [&](const auto& options, const char* home) -> absl::Status {
    for (const auto& [name, given] : options)
      if (given)
        return absl::InvalidArgumentError(
            absl::StrCat(name, " belongs to ", home, ", not to --plan ", o.plan));
    return absl::OkStatus();
  };
  if (o.plan != "sphere") TOUCHSTONE_RETURN_IF_ERROR(misplaced(sphere_only, "--plan sphere"));
  if (o.plan != "faces") TOUCHSTONE_RETURN_IF_ERROR(misplaced(faces_only, "--plan faces"));

  v1::Plan plan;
  if (o.plan == "sphere" || o.plan == "faces") {
    plan.set_speed_m_s(ToSi(Unit::kMillimetrePerSecond, o.speed_mm_s.value_or(kSpeedMmS)));
    plan.set_touch_interval_s(o.touch_interval_s.value_or(0));
  }
  // Zero means "default" on the wire; here it is what the user typed, and wrong.
  const auto positive = [](const char* name, double value) {
    return value > 0 ? absl::OkStatus()
                     : absl::InvalidArgumentError(
                           absl::StrCat(name, ": ", ShortestNumber(value), " is out of range; above 0"));
  };
  TOUCHSTONE_RETURN_IF_ERROR(positive("--speed-mm-s", o.speed_mm_s.value_or(kSpeedMmS)));
  if (const double deg = o.max_incidence_deg.value_or(90); !(deg >= 0.1 && deg <= 90))
    return absl::InvalidArgumentError(
        absl::StrCat("--max-incidence-deg: ", ShortestNumber(deg), " is out of range; 0.1 to 90"));
  if (o.plan == "sphere") {
    TOUCHSTONE_RETURN_IF_ERROR(positive("--step-angle-deg", o.step_angle_deg.value_or(kStepAngleDeg)));
    TOUCHSTONE_RETURN_IF_ERROR(positive("--radius-ratio", o.radius_ratio.value_or(kRadiusRatio)));
    v1::SpherePlan* sphere = plan.mutable_sphere();
    sphere->set_step_angle_rad(ToSi(Unit::kDegree, o.step_angle_deg.value_or(kStepAngleDeg)));
    sphere->set_roll_step_rad(ToSi(Unit::kDegree, o.roll_step_deg.value_or(0)));
    sphere->set_radius_ratio(o.radius_ratio.value_or(o.pictures ? kRadiusRatioOfPictures : kRadiusRatio));
    sphere->set_max_incidence_rad(ToSi(Unit::kDegree, o.max_incidence_deg.value_or(kSphereMaxIncidenceDeg)));
    return plan;
  }
  if (o.plan == "faces") {
    TOUCHSTONE_RETURN_IF_ERROR(positive("--samples-per-face", o.samples_per_face.value_or(kSamplesPerFace)));
    TOUCHSTONE_RETURN_IF_ERROR(positive("--rounds", o.rounds.value_or(kRounds)));
    TOUCHSTONE_RETURN_IF_ERROR(positive("--standoff-mm", o.standoff_mm.value_or(kStandoffMm)));
    const double beyond_mm = o.stroke_beyond_target_mm.value_or(kStrokeBeyondTargetMm);
    TOUCHSTONE_RETURN_IF_ERROR(positive("--stroke-beyond-target-mm", beyond_mm));
    v1::FacesPlan* faces = plan.mutable_faces();
    faces->set_samples_per_face(o.samples_per_face.value_or(kSamplesPerFace));
    faces->set_rounds(o.rounds.value_or(kRounds));
    faces->set_max_tilt_rad(ToSi(Unit::kDegree, o.max_tilt_deg.value_or(kMaxTiltDeg)));
    faces->set_spread(o.spread.value_or(kSpread));
    faces->set_standoff_m(ToSi(Unit::kMillimetre, o.standoff_mm.value_or(kStandoffMm)));
    faces->set_max_incidence_rad(ToSi(Unit::kDegree, o.max_incidence_deg.value_or(kFacesMaxIncidenceDeg)));
    faces->set_stroke_beyond_target_m(ToSi(Unit::kMillimetre, beyond_mm));
    return plan;
  }
  TOUCHSTONE_RETURN_IF_ERROR(misplaced(not_in_list, "--plan sphere and faces"));
  std::error_code error;
  if (!std::filesystem::exists(o.plan, error))
    return absl::NotFoundError(absl::StrCat("--plan: '", o.plan, "' is no generator and no file",
                                            DidYouMean(o.plan, {"sphere", "faces"})));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<client::MeasuredTouch> touches, ReadTouches(o.plan));
  for (client::MeasuredTouch& touch : touches) {
    *plan.mutable_list()->add_touches() = std::move(touch.commanded);
    if (objects != nullptr && std::find(objects->begin(), objects->end(), touch.object) == objects->end())
      objects->push_back(touch.object);
  }
  return plan;
}

absl::StatusOr<std::optional<std::vector<PlannedPicture>>> ReadPictures(const std::string& path,
                                                                        const std::string& object) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, kMaxPlanBytes));
  const std::string header = text.substr(0, text.find('\n'));
  if (!absl::StrContains(header, "eye_x_mm")) return std::optional<std::vector<PlannedPicture>>();
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::ImageSet plan, session::ParseImagesCsv(text, path));
  std::vector<PlannedPicture> pictures;
  for (const session::PhotographRow& row : plan.photographs) {
    if (plan.objects[row.object] != object) continue;
    PlannedPicture& picture = pictures.emplace_back();
    picture.file = row.file;
    v1::CameraPose* camera = picture.view.mutable_camera();
    *camera->mutable_eye_m() = service::ToProto(row.commanded.eye_m);
    *camera->mutable_at_m() = service::ToProto(row.commanded.at_m);
    *camera->mutable_up() = service::ToProto(row.commanded.up);
  }
  if (pictures.empty())
    return absl::NotFoundError(absl::StrCat(path, ": has no picture of '", object, "'; it has pictures of ",
                                            absl::StrJoin(plan.objects, ", ")));
  return std::make_optional(std::move(pictures));
}

absl::StatusOr<std::vector<client::MeasuredTouch>> ReadTouches(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, kMaxPlanBytes));
  return client::ParseMeasurements(text, path);
}

std::string CloseCameraNote(const v1::Plan& plan, const v1::Object& object, double vertical_fov_rad) {
  const auto corner = [](const v1::Vector3& v) { return Eigen::Vector3d(v.x(), v.y(), v.z()); };
  const double half_m = 0.5 * (corner(object.bounds_max_m()) - corner(object.bounds_min_m())).norm();
  double distance_m = plan.has_sphere() ? plan.sphere().radius_ratio() * half_m : plan.faces().standoff_m();
  if (plan.has_list()) {
    std::vector<double> standoffs_m;
    for (const v1::CommandedTouch& touch : plan.list().touches()) standoffs_m.push_back(touch.standoff_m());
    if (standoffs_m.empty()) return "";
    const auto middle = standoffs_m.begin() + static_cast<std::ptrdiff_t>(standoffs_m.size() / 2);
    std::nth_element(standoffs_m.begin(), middle, standoffs_m.end());
    distance_m = *middle;
  }
  const double shown_m = distance_m * std::tan(vertical_fov_rad / 2);
  if (half_m <= 0 || shown_m >= kMinShownShare * half_m) return "";
  const auto mm = [](double metres) {
    return absl::StrCat(std::lround(FromSi(Unit::kMillimetre, metres)), " mm");
  };
  return absl::StrCat(
      "the camera of a touch stands where the touch begins, so near to '", object.name(),
      "' that a picture shows ", mm(2 * shown_m), " of an object of ", mm(2 * half_m),
      ": most pictures have no outline. ",
      plan.has_sphere() ? absl::StrCat("--radius-ratio ", ShortestNumber(kRadiusRatioOfPictures))
      : plan.has_faces()
          ? absl::StrCat("--standoff-mm ",
                         std::lround(FromSi(Unit::kMillimetre, half_m * kRadiusRatioOfPictures)))
          : "Longer standoffs in the file",
      " or a larger --fov-deg shows all of it");
}

void AddImageOptions(CLI::App* command, ImageFlags* options) {
  const auto add = [&](const std::string& name, auto& value, const std::string& type,
                       const std::string& text) {
    command->add_option(name, value, text)->type_name(type)->group(kImageGroup);
  };
  add("--image", options->size, "WxH", "Size of images in pixels, up to 2048x2048, for instance 224x224");
  add("--format", options->format, "FORMAT", "grey or rgb. Default: grey");
  add("--shading-style", options->shading_style, "STYLE",
      "shaded: lit, on black; dark-on-white: a dark object on white. Default: shaded");
  add("--jpeg-quality", options->jpeg_quality, "1-100", "Of JPEG files. Default: 90");
  add("--fov-deg", options->fov_deg, "DEG", "Vertical field of view. Default: 45");
  command
      ->add_flag("--depth", options->depth, "Also depth along the viewing axis, in mm, 0 where no object is")
      ->group(kImageGroup);
  command
      ->add_flag(
          "--normalize", options->normalize,
          "A dark object on white, without ground and shadows; --mask is then the one that this finds. A "
          "picture without ground around the object becomes white, and its mask empty")
      ->group(kImageGroup);
  command->add_flag("--mask", options->mask, "Also the object's mask, 255 on the object, 0 beside it")
      ->group(kImageGroup);
}

absl::StatusOr<v1::ImageSpec> MakeImageSpec(const Cli& cli, const ImageFlags& o,
                                            const std::string& encoding) {
  v1::ImageSpec spec;
  const std::string size = o.size.empty() ? "224x224" : o.size;
  const size_t cross = size.find('x');
  uint32_t width = 0, height = 0;
  if (cross == std::string::npos || !absl::SimpleAtoi(size.substr(0, cross), &width) ||
      !absl::SimpleAtoi(size.substr(cross + 1), &height) || width == 0 || height == 0)
    return absl::InvalidArgumentError(absl::StrCat(
        "--image: '", size, "' is no size; WIDTHxHEIGHT in pixels from 1x1 on, for instance 224x224"));
  spec.set_width(width);
  spec.set_height(height);
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--format", o.format, {"grey", "rgb"}).status());
  spec.set_format(o.format == "rgb" ? v1::PIXEL_FORMAT_RGB : v1::PIXEL_FORMAT_GREY);
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--shading-style", o.shading_style, {"shaded", "dark-on-white"}).status());
  spec.set_shading_style(o.shading_style == "shaded" ? v1::SHADING_STYLE_SHADED
                                                     : v1::SHADING_STYLE_DARK_ON_WHITE);
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--encoding", encoding, {"png", "jpeg", "raw"}).status());
  spec.set_encoding(encoding == "png"    ? v1::IMAGE_ENCODING_PNG
                    : encoding == "jpeg" ? v1::IMAGE_ENCODING_JPEG
                                         : v1::IMAGE_ENCODING_RAW);
  if (o.jpeg_quality < 1 || o.jpeg_quality > 100)
    return absl::InvalidArgumentError(
        absl::StrCat("--jpeg-quality: ", o.jpeg_quality, " is out of range; 1 to 100"));
  if (spec.encoding() == v1::IMAGE_ENCODING_JPEG) spec.set_jpeg_quality(o.jpeg_quality);
  if (!(o.fov_deg > 0 && o.fov_deg < 180))
    return absl::InvalidArgumentError(
        absl::StrCat("--fov-deg: ", ShortestNumber(o.fov_deg), " is out of range; above 0, below 180"));
  spec.set_vertical_fov_rad(ToSi(Unit::kDegree, o.fov_deg));
  spec.set_depth(o.depth);
  spec.set_mask(o.mask);
  spec.set_normalize(o.normalize);
  TOUCHSTONE_ASSIGN_OR_RETURN(const image::RendererOptions renderer, cli.Renderer());
  if (renderer.kind == image::RendererKind::kEgl) spec.set_renderer(v1::RENDERER_KIND_EGL);
  if (renderer.kind == image::RendererKind::kCpu) spec.set_renderer(v1::RENDERER_KIND_CPU);
  return spec;
}

}  // namespace touchstone::cli
