#include "server/gateway/camera/camera.h"

#include <cmath>
#include <cstdlib>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "server/base/check.h"
#include "server/base/status.h"
#include "server/gateway/camera/camera_kinds.h"
#include "server/image/encoding/whole_picture.h"

namespace touchstone::gateway::camera {
namespace {

constexpr double kMaxLatencyS = 10;

}  // namespace

void QuietOpenCv() {
  static const bool quiet = [] {
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);  // FFmpeg's own; read when it is first used
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
    return true;
  }();
  (void)quiet;
}

image::Frame FrameOf(const cv::Mat& picture, double host_time_s, uint64_t number) {
  image::Frame frame;
  frame.width = picture.cols;
  frame.height = picture.rows;
  frame.host_time_s = host_time_s;
  frame.number = number;
  frame.rgb.resize(static_cast<size_t>(picture.rows) * picture.cols * 3);
  cv::Mat rgb(picture.rows, picture.cols, CV_8UC3, frame.rgb.data());
  TOUCHSTONE_CHECK(picture.depth() == CV_8U);
  cv::cvtColor(picture, rgb, picture.channels() == 1 ? cv::COLOR_GRAY2RGB : cv::COLOR_BGR2RGB);
  return frame;
}

absl::StatusOr<cv::Mat> DecodeWhole(absl::string_view bytes) {
  TOUCHSTONE_RETURN_IF_ERROR(image::CheckWholePicture(bytes));
  const cv::Mat coded(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  cv::Mat picture;
  try {
    picture = cv::imdecode(coded, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
  }
  if (picture.empty()) return absl::InvalidArgumentError("cannot be decoded; the picture is damaged");
  return picture;
}

bool TakesJpegsAsTheyCame(cv::VideoCapture* stream) {
  // V4L2 says MJPG, FFmpeg the name of its decoder.
  const uint32_t code = static_cast<uint32_t>(stream->get(cv::CAP_PROP_FOURCC));
  std::string name;
  for (int shift = 0; shift < 32; shift += 8)
    name += absl::ascii_tolower(static_cast<unsigned char>(code >> shift & 0xFF));
  if (name != "mjpg" && name != "mjpe" && name != "jpeg") return false;
  return stream->getBackendName() == "FFMPEG" ? stream->set(cv::CAP_PROP_FORMAT, -1)
                                              : stream->set(cv::CAP_PROP_CONVERT_RGB, 0);
}

absl::StatusOr<std::unique_ptr<CameraDevice>> CameraDevice::Open(const CameraOptions& options) {
  QuietOpenCv();
  const CameraKind kind = CameraKindOf(options.uri);
  if (kind == CameraKind::kNone)
    return absl::FailedPreconditionError(
        "no camera: its address is empty; right is /dev/video0, folder:PATH, video:FILE or http://...");
  if (!(options.timeout_s > 0 && std::isfinite(options.timeout_s)))
    return absl::InvalidArgumentError(
        absl::StrCat("camera: timeout_s is ", options.timeout_s, "; right is above 0"));
  if (!(options.latency_s >= 0 && options.latency_s <= kMaxLatencyS))
    return absl::InvalidArgumentError(
        absl::StrCat("camera: latency_s is ", options.latency_s, "; right is from 0 to ", kMaxLatencyS));
  if (options.width < 0 || options.height < 0)
    return absl::InvalidArgumentError(absl::StrCat("camera: size ", options.width, " x ", options.height,
                                                   "; right is above 0, or 0 as it comes"));
  const std::string path = options.uri.substr(options.uri.find(':') + 1);
  if (kind == CameraKind::kFolder) return OpenFolderCamera(options, path);
  if (kind == CameraKind::kVideo) return OpenVideoCamera(options, path);
  return OpenStreamCamera(options);
}

}  // namespace touchstone::gateway::camera
