// The camera of the rig: a UVC camera or a video through OpenCV, or a folder of pictures.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/timing/change_notifier.h"
#include "server/image/photograph/photograph.h"

namespace touchstone::gateway::camera {

// OpenCV's YAML or XML file, as its calibration tools write it. Errors name the file and the field.
absl::StatusOr<image::Intrinsics> ReadIntrinsics(const std::string& path);

// The numbers are those of v1::CameraKind.
enum class CameraKind : int {
  kNone = 0,
  kUvc = 1,     // a USB camera, "/dev/video0" or "0"
  kStream = 2,  // pictures over HTTP, "http://..."
  kFolder = 3,  // the newest picture of a folder, in the order of names, "folder:PATH"
  kVideo = 4,   // a recorded video, "video:FILE"
};
CameraKind CameraKindOf(const std::string& uri);  // "": none

struct CameraOptions {
  std::string uri;            // of one of the kinds above; empty: none
  int width = 0, height = 0;  // asked of the camera; 0: as it comes
  std::string intrinsics;     // file; empty: the field of view below, no distortion
  double vertical_fov_rad = 0.7853981633974483;
  double timeout_s = 2;
  double latency_s = 0;  // from the exposure of a picture until it is here (stream, UVC) or written (folder)
  const Clock* clock = &timing::HostClock();  // outlives the camera
};

class CameraDevice {
 public:
  static absl::StatusOr<std::unique_ptr<CameraDevice>> Open(const CameraOptions& options);
  virtual ~CameraDevice() = default;

  // A picture that was exposed after `after_host_s`: older ones in the driver's queue, and those that come before
  // latency_s has passed, are thrown away. UNAVAILABLE if none comes in time, DATA_LOSS if the camera repeats one picture
  // bit by bit (frozen) or sends none that is whole.
  virtual absl::StatusOr<image::Frame> Take(double after_host_s) = 0;
  virtual CameraKind kind() const = 0;
  virtual std::string Description() const = 0;
  virtual uint64_t frames() const = 0;
  virtual uint64_t stale_frames() const = 0;
};

// The picture scaled to width x height pixels of the given vertical field of view without distortion, as a
// virtual source renders it: rgb or grey.
std::vector<uint8_t> Rectify(const image::Frame& frame, const image::Intrinsics& intrinsics, int width,
                             int height, double vertical_fov_rad, bool grey);

}  // namespace touchstone::gateway::camera
