#include "server/source/physical_source.h"

#include <absl/strings/str_cat.h>

#include <atomic>
#include <chrono>
#include <map>

#include "server/base/status.h"
#include "server/session/journal/command_bytes.h"
#include "server/source/physical_samples.h"

namespace touchstone::source {
namespace {

constexpr double kUsualTouchDurationS = 8;  // until a rig has measured its own

// As the protocol has it, looking at what is so far away.
PhotographPose PoseOf(const Photograph& photograph, double distance_m) {
  PhotographPose pose;
  pose.unix_s = photograph.unix_s;
  pose.deviation_m = photograph.deviation_m, pose.deviation_rad = photograph.deviation_rad;
  if (!photograph.object_from_camera.has_value()) return pose;
  const Eigen::Isometry3d& object_from_camera = *photograph.object_from_camera;
  image::Camera& camera = pose.measured.emplace();
  camera.eye_m = object_from_camera.translation();
  camera.at_m = camera.eye_m + distance_m * object_from_camera.linear().col(2);
  camera.up = -object_from_camera.linear().col(1);
  return pose;
}

std::string NewTouchId() {
  static std::atomic<uint64_t> count{0};
  return absl::StrCat("touch-", std::chrono::system_clock::now().time_since_epoch().count(), "-", ++count);
}

}  // namespace

absl::Status CheckPhotograph(const dataset::DatasetImage& wanted) {
  if (wanted.options.depth || (wanted.options.mask && !wanted.normalize))
    return absl::InvalidArgumentError(
        "image.depth, image.mask: this source's camera sees colours only; ask for none, or for the mask of a "
        "normalised picture (image.normalize)");
  if (wanted.options.shading_style != image::ShadingStyle::kShaded)
    return absl::InvalidArgumentError(
        "image.shading_style: this source's camera shows what it sees; leave it unspecified");
  return absl::OkStatus();
}

image::Image ImageOf(const Photograph& photograph, const RigDevice& device, const Rectifier& rectify,
                     const dataset::DatasetImage& wanted) {
  const image::Frame& frame = photograph.frame;
  const image::ImageOptions& options = wanted.options;
  image::Image picture;
  picture.width = options.width;
  picture.height = options.height;
  picture.channels = options.format == image::PixelFormat::kRgb ? 3 : 1;
  picture.pixels = rectify(frame, device.IntrinsicsOf(frame), options.width, options.height,
                           wanted.vertical_fov_rad, options.format == image::PixelFormat::kGrey);
  return picture;
}

Eigen::Isometry3d ObjectFromCamera(const image::Camera& camera) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d ahead = (camera.at_m - camera.eye_m).normalized();
  const Eigen::Vector3d right = ahead.cross(camera.up).normalized();
  pose.linear() << right, ahead.cross(right), ahead;
  pose.translation() = camera.eye_m;
  return pose;
}

std::shared_ptr<const model::Model> NominalModelOf(const RigDevice& device) {
  return std::make_shared<const model::Model>(model::NominalModel(device.fingers(), device.spacing_m()));
}

SourceInfo PhysicalSource::Describe() const {
  const SourceStatus status = device_->Status();
  SourceInfo info;
  info.kind = SourceKind::kPhysical;
  info.plans = {touch::Plan::Kind::kFaces, touch::Plan::Kind::kList};
  info.makes_images = device_->has_camera();
  info.max_fingers = device_->fingers();
  info.moves = device_->moves();
  info.touch_duration_s =
      info.moves && status.touch_duration_s == 0 ? kUsualTouchDurationS : status.touch_duration_s;
  info.clock_uncertainty_s = status.clock_uncertainty_s;
  return info;
}

absl::StatusOr<TouchResults> PhysicalSource::MakeTouches(const TouchRequest& request,
                                                         const ServedObject& object,
                                                         const MotionGuard& guard) {
  TouchResults results;
  results.fingers = device_->fingers();
  TOUCHSTONE_ASSIGN_OR_RETURN(results.session, SessionName(request.session));
  std::map<std::string, uint64_t> repeats;
  for (size_t k = 0; k < request.touches.size(); ++k) {
    TouchCommand command;
    command.session = results.session;
    command.id = request.ids.empty() ? NewTouchId() : request.ids[k];
    command.object = request.object;
    command.bounds = object.surface->bounds();
    command.touch = request.touches[k];
    command.bytes = session::CommandBytes(command.touch);
    command.series = request.series;
    command.repeat = repeats[command.bytes]++;
    TOUCHSTONE_ASSIGN_OR_RETURN(session::JournalTouch touch, device_->Touch(command, guard));
    for (const session::JournalFinger& finger : touch.result.fingers)
      results.contact_time_s.push_back(finger.contact_time_s);
    if (request.series) {
      TOUCHSTONE_ASSIGN_OR_RETURN(results.series.emplace_back(), device_->Series(results.session, touch.id));
    }
    results.journalled.push_back(std::move(touch));
  }
  return results;
}

absl::Status PhysicalSource::MakePictures(const CaptureRequest& request, const ServedObject& object,
                                          const MotionGuard& guard, const TakePicture& take) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckPhotograph(request.image));
  for (const image::Camera& camera : request.cameras) {
    const ViewCommand command{"default", request.object, object.surface->bounds(), ObjectFromCamera(camera),
                              camera};
    TOUCHSTONE_ASSIGN_OR_RETURN(const Photograph photograph, device_->Photograph(command, guard));
    const PhotographPose pose = PoseOf(photograph, (camera.at_m - camera.eye_m).norm());
    TOUCHSTONE_RETURN_IF_ERROR(take(ImageOf(photograph, *device_, rectify_, request.image), &pose));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<SampleStream>> PhysicalSource::MakeStream(const SampleRequest& request) {
  return PhysicalSamples::Create(request, device_.get(), rectify_);
}

}  // namespace touchstone::source
