// What stands in for the rest of this folder in a build without OpenCV (TOUCHSTONE_CAMERA=OFF).
#include "server/gateway/camera/camera.h"

namespace touchstone::gateway::camera {
namespace {

absl::Status Absent() {
  return absl::UnimplementedError(
      "this build has no camera; leave the camera out of the rig's options, or build with "
      "-DTOUCHSTONE_CAMERA=ON "
      "(Debian: libopencv-videoio-dev, libopencv-imgcodecs-dev, libopencv-calib3d-dev)");
}

}  // namespace

absl::StatusOr<std::unique_ptr<CameraDevice>> CameraDevice::Open(const CameraOptions& /*options*/) {
  return Absent();
}

absl::StatusOr<image::Intrinsics> ReadIntrinsics(const std::string& /*path*/) {
  return Absent();
}

// Without a camera there is no frame, so nobody comes here.
std::vector<uint8_t> Rectify(const image::Frame& /*frame*/, const image::Intrinsics& /*intrinsics*/,
                             int width, int height, double /*vertical_fov_rad*/, bool grey) {
  return std::vector<uint8_t>(static_cast<size_t>(width) * height * (grey ? 1 : 3));
}

}  // namespace touchstone::gateway::camera
