// The camera of a touch, and what is refused before anything is drawn.
#include <cmath>

#include <Eigen/Geometry>

#include <absl/strings/str_format.h>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/image/image.h"
#include "server/image/renderers/renderer.h"

namespace touchstone::image {
namespace {

// Beyond this the single-precision meshes of tools have no pixel-sized detail left.
constexpr double kFarthestM = 1e6;
constexpr double kSmallestFovRad = 0.01 * kRadiansPerDegree;
constexpr double kLargestFovRad = 170.0 * kRadiansPerDegree;
// Sine of the smallest angle between the viewing axis and the up vector.
constexpr double kSmallestUpSine = 1e-6;

std::string Text(const Eigen::Vector3d& v) {
  return absl::StrFormat("(%g, %g, %g)", v.x(), v.y(), v.z());
}

absl::Status CheckPosition(const char* field, const Eigen::Vector3d& position_m) {
  if (position_m.allFinite() && position_m.cwiseAbs().maxCoeff() <= kFarthestM) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat("%s is %s; must be three finite numbers of at most %g m",
                                                    field, Text(position_m), kFarthestM));
}

absl::Status CheckSide(const char* field, int pixels) {
  if (pixels >= 1 && pixels <= kMaxImageSide) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("%s is %d pixels; must be from 1 to %d", field, pixels, kMaxImageSide));
}

// 0 means "enclose the object".
absl::Status CheckPlane(const char* field, double depth_m) {
  if (std::isfinite(depth_m) && depth_m >= 0 && depth_m <= 10 * kFarthestM) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s is %g; must be a depth in metres greater than 0, or 0 to enclose the object", field, depth_m));
}

}  // namespace

Camera CameraOfTouch(const Eigen::Vector3d& target_m, const Eigen::Vector3d& approach,
                     const Eigen::Vector3d& lateral, double standoff_m) {
  Camera camera;
  camera.eye_m = target_m - approach * standoff_m;
  camera.at_m = target_m;
  camera.up = lateral.cross(approach);
  return camera;
}

absl::Status ValidateImageRequest(const Camera& camera, const ImageOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckSide("width", options.width));
  TOUCHSTONE_RETURN_IF_ERROR(CheckSide("height", options.height));
  TOUCHSTONE_RETURN_IF_ERROR(CheckPosition("camera.eye_m", camera.eye_m));
  TOUCHSTONE_RETURN_IF_ERROR(CheckPosition("camera.at_m", camera.at_m));

  const Eigen::Vector3d view = camera.at_m - camera.eye_m;
  if (!(view.norm() > 1e-9)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("camera.at_m is %s, the same as camera.eye_m; must be another point, the one that "
                        "the camera looks at",
                        Text(camera.at_m)));
  }
  const double up_norm = camera.up.norm();
  if (!std::isfinite(up_norm) || !(up_norm > 1e-12)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("camera.up is %s; must be a finite vector that is not zero", Text(camera.up)));
  }
  if (!((view.normalized().cross(camera.up / up_norm)).norm() > kSmallestUpSine)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "camera.up is %s, parallel to the view from eye %s to at %s; must point to the image's top",
        Text(camera.up), Text(camera.eye_m), Text(camera.at_m)));
  }
  if (!(camera.vertical_fov_rad >= kSmallestFovRad && camera.vertical_fov_rad <= kLargestFovRad)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("camera.vertical_fov_rad is %g; must be from %g to %g (0.01 to 170 deg)",
                        camera.vertical_fov_rad, kSmallestFovRad, kLargestFovRad));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckPlane("camera.near_m", camera.near_m));
  TOUCHSTONE_RETURN_IF_ERROR(CheckPlane("camera.far_m", camera.far_m));
  if (camera.near_m > 0 && camera.far_m > 0 && !(camera.near_m < camera.far_m)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "camera.near_m is %g; must be less than camera.far_m, %g", camera.near_m, camera.far_m));
  }
  return absl::OkStatus();
}

}  // namespace touchstone::image
