#include <filesystem>
#include <mutex>

#include <absl/strings/str_cat.h>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "server/gateway/camera/camera_kinds.h"

namespace touchstone::gateway::camera {
namespace {

class VideoCamera : public CameraDevice {
 public:
  VideoCamera(std::string path, const Clock& clock) : path_(std::move(path)), clock_(clock) {}

  absl::Status Start() {
    try {
      if (Open()) return absl::OkStatus();
    } catch (const cv::Exception&) {
    }
    return absl::InvalidArgumentError(absl::StrCat("camera: ", path_, " is no video that OpenCV can read"));
  }
  absl::StatusOr<image::Frame> Take(double /*after_host_s*/) override {
    std::lock_guard<std::mutex> lock(mutex_);
    try {
      cv::Mat picture;
      if (!video_.read(picture)) {
        // Opened again rather than wound back, which not every container can.
        video_.release();
        if (!Open() || !video_.read(picture))
          return absl::UnavailableError(absl::StrCat("camera: video ", path_, " cannot be read any more"));
      }
      if (jpegs_) {
        const absl::StatusOr<cv::Mat> decoded = DecodeWhole(absl::string_view(
            reinterpret_cast<const char*>(picture.data), picture.total() * picture.elemSize()));
        if (!decoded.ok())
          return absl::DataLossError(absl::StrCat("camera: video ", path_, ", picture ", frames_ + 1, ": ",
                                                  decoded.status().message()));
        picture = *decoded;
      }
      return FrameOf(picture, clock_.NowS(), ++frames_);
    } catch (const cv::Exception& problem) {
      return absl::UnavailableError(absl::StrCat("camera: video ", path_, ": ", problem.err));
    }
  }
  CameraKind kind() const override { return CameraKind::kVideo; }
  std::string Description() const override { return absl::StrCat("video ", path_); }
  uint64_t frames() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return frames_;
  }
  uint64_t stale_frames() const override { return 0; }

 private:
  bool Open() {
    if (!video_.open(path_, cv::CAP_FFMPEG) && !video_.open(path_)) return false;
    jpegs_ = TakesJpegsAsTheyCame(&video_);
    return true;
  }

  const std::string path_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  cv::VideoCapture video_;
  bool jpegs_ = false;
  uint64_t frames_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CameraDevice>> OpenVideoCamera(const CameraOptions& options,
                                                              const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return absl::NotFoundError(absl::StrCat("camera: there is no video ", path));
  auto camera = std::make_unique<VideoCamera>(path, *options.clock);
  if (absl::Status status = camera->Start(); !status.ok()) return status;
  return camera;
}

}  // namespace touchstone::gateway::camera
