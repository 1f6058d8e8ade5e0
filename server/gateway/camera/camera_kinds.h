// The kinds of cameras behind CameraDevice::Open.
#pragma once

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/gateway/camera/camera.h"

namespace cv {
class Mat;
class VideoCapture;
}  // namespace cv

namespace touchstone::gateway::camera {

// Pictures as a driver hands them over, one after the other. For one thread. Grab and Retrieve may throw cv::Exception,
// which counts as a stream that broke.
class PictureStream {
 public:
  virtual ~PictureStream() = default;
  // Also again, after it broke.
  virtual absl::Status Open() = 0;
  // Waits for the next picture; false if the stream broke.
  virtual bool Grab() = 0;
  // What was grabbed last. DATA_LOSS: it is not whole; the next one may be.
  virtual absl::Status Retrieve(cv::Mat* picture) = 0;
};

// A camera that delivers frames all the time: UVC, or pictures over HTTP. Opened again when it was unplugged.
// Real pictures are never equal bit by bit (but for a covered lens), so equal ones mean that it froze.
absl::StatusOr<std::unique_ptr<CameraDevice>> OpenStreamCamera(const CameraOptions& options);
// The same of any stream.
absl::StatusOr<std::unique_ptr<CameraDevice>> OpenStreamCamera(const CameraOptions& options,
                                                               std::unique_ptr<PictureStream> stream);

// A folder into which another program puts pictures (whole: written under another name, then renamed). A
// picture's time is that of its file's last change, and equal pictures are legitimate.
absl::StatusOr<std::unique_ptr<CameraDevice>> OpenFolderCamera(const CameraOptions& options,
                                                               const std::string& path);

// A recorded video: every Take gives the next picture, taken now, and after the last the first again. Equal
// pictures are legitimate.
absl::StatusOr<std::unique_ptr<CameraDevice>> OpenVideoCamera(const CameraOptions& options,
                                                              const std::string& path);

// Of a picture in OpenCV's order (blue first) or grey.
image::Frame FrameOf(const cv::Mat& picture, double host_time_s, uint64_t number);
// Of a file's bytes, in OpenCV's order. INVALID_ARGUMENT: it is not whole (image::CheckWholePicture), or no picture.
absl::StatusOr<cv::Mat> DecodeWhole(absl::string_view bytes);

// Whether what was just opened sends JPEG pictures. If so it hands them over as they came from now on, one row of bytes
// each: decoded by FFmpeg, a picture that is cut off looks like a whole one.
bool TakesJpegsAsTheyCame(cv::VideoCapture* stream);

// OpenCV writes nothing to stderr from now on; its errors come back as exceptions, which are caught here.
void QuietOpenCv();

}  // namespace touchstone::gateway::camera
