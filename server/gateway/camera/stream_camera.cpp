// A thread takes every picture off the driver's queue as it comes, so that the queue never holds old ones;
// only those that somebody waits for are decoded where the driver leaves a choice.
#include <algorithm>
#include <cctype>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>

#include <absl/strings/str_cat.h>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "server/base/status.h"
#include "server/gateway/camera/camera_kinds.h"

namespace touchstone::gateway::camera {
namespace {

// A picture for which nobody had to wait so long stood in a queue; a queue is empty after kDrainS.
constexpr double kWaitS = 0.004, kDrainS = 0.5;
constexpr double kReopenS = 0.2;

bool IsNumber(const std::string& text) {
  return !text.empty() && text.size() < 6 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

// Of OpenCV.
class OpenCvStream final : public PictureStream {
 public:
  explicit OpenCvStream(CameraOptions options) : options_(std::move(options)) {}

  absl::Status Open() override {
    if (!OpenDevice())
      return absl::UnavailableError(
          absl::StrCat("camera: ", options_.uri,
                       " cannot be opened; is it there, is it a camera, and does nobody else use it?"));
    jpegs_ = TakesJpegsAsTheyCame(&stream_);
    // What a UVC camera sends uncompressed is whole: the driver drops a picture of which bytes are missing (uvcvideo,
    // parameter nodrop). In other codecs what is missing is filled in from older pictures.
    if (!jpegs_ && CameraKindOf(options_.uri) == CameraKind::kStream)
      return absl::FailedPreconditionError(
          absl::StrCat("camera: ", options_.uri,
                       " does not send JPEG pictures one by one (MJPEG), so that "
                       "nobody could tell whether one is whole; set the camera to MJPEG"));
    return absl::OkStatus();
  }
  bool Grab() override { return stream_.grab(); }
  absl::Status Retrieve(cv::Mat* picture) override {
    cv::Mat taken;
    if (!stream_.retrieve(taken) || taken.empty()) return absl::DataLossError("it cannot be decoded");
    if (!jpegs_) {
      *picture = taken;
      return absl::OkStatus();
    }
    if (!taken.isContinuous()) taken = taken.clone();
    absl::StatusOr<cv::Mat> decoded = DecodeWhole(
        absl::string_view(reinterpret_cast<const char*>(taken.data), taken.total() * taken.elemSize()));
    if (!decoded.ok()) return absl::DataLossError(decoded.status().message());
    *picture = *std::move(decoded);
    return absl::OkStatus();
  }

 private:
  bool OpenDevice() {
    try {
      stream_.release();
      const std::string& uri = options_.uri;
      if (CameraKindOf(uri) == CameraKind::kStream) {
        const int timeout_ms = static_cast<int>(options_.timeout_s * 1000);
        if (!stream_.open(
                uri, cv::CAP_FFMPEG,
                {cv::CAP_PROP_OPEN_TIMEOUT_MSEC, timeout_ms, cv::CAP_PROP_READ_TIMEOUT_MSEC, timeout_ms}))
          return false;
      } else if (!(IsNumber(uri) ? stream_.open(std::stoi(uri), cv::CAP_V4L2)
                                 : stream_.open(uri, cv::CAP_V4L2))) {
        return false;
      }
      if (options_.width > 0) stream_.set(cv::CAP_PROP_FRAME_WIDTH, options_.width);
      if (options_.height > 0) stream_.set(cv::CAP_PROP_FRAME_HEIGHT, options_.height);
      return true;
    } catch (const cv::Exception&) {
      return false;
    }
  }

  const CameraOptions options_;
  cv::VideoCapture stream_;
  bool jpegs_ = false;
};

class StreamCamera : public CameraDevice {
 public:
  StreamCamera(CameraOptions options, std::unique_ptr<PictureStream> stream)
      : options_(std::move(options)), stream_(std::move(stream)) {}
  ~StreamCamera() override {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

  absl::Status Start() {
    TOUCHSTONE_RETURN_IF_ERROR(stream_->Open());
    thread_ = std::thread([this] { Run(); });
    return absl::OkStatus();
  }

  absl::StatusOr<image::Frame> Take(double after_host_s) override {
    std::lock_guard<std::mutex> one(take_mutex_);
    std::unique_lock<std::mutex> lock(mutex_);
    wanted_ = true;
    wanted_after_s_ = after_host_s + options_.latency_s;
    repeated_ = false;
    has_result_ = false;
    damaged_ = 0;
    // Of what is asked for ahead of time, the time until then does not count.
    const double patience_s =
        options_.timeout_s + std::clamp(wanted_after_s_ - options_.clock->NowS(), 0.0, 60.0);
    options_.clock->WaitFor(lock, changed_, patience_s, [this] { return has_result_; });
    wanted_ = false;
    if (has_result_) return std::move(result_);
    if (repeated_)
      return absl::DataLossError(absl::StrCat(
          "camera ", options_.uri, " repeats one picture bit by bit: it is frozen; plug it in anew"));
    if (damaged_ > 0)
      return absl::DataLossError(absl::StrCat("camera ", options_.uri, ": no whole picture in ",
                                              options_.timeout_s, " s; ", damaged_,
                                              " that came were refused, the last one: ", damage_));
    return absl::UnavailableError(absl::StrCat("camera ", options_.uri, ": no picture in ",
                                               options_.timeout_s, " s", why_.empty() ? "" : ": ", why_));
  }

  CameraKind kind() const override { return CameraKindOf(options_.uri); }
  std::string Description() const override { return absl::StrCat("camera ", options_.uri); }
  uint64_t frames() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return frames_;
  }
  uint64_t stale_frames() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return stale_frames_;
  }

 private:
  void Run() {
    bool open = true;
    while (true) {
      {
        std::unique_lock<std::mutex> lock(mutex_);
        if (stopping_) return;
        if (!open) {
          options_.clock->WaitFor(lock, changed_, kReopenS, [this] { return stopping_; });
          if (stopping_) return;
        }
      }
      if (!open) open = stream_->Open().ok();
      if (open) open = Next();
      if (!open) {
        std::lock_guard<std::mutex> lock(mutex_);
        why_ = "it is gone";
      }
    }
  }

  // The next picture off the queue; false if the stream broke.
  bool Next() {
    try {
      const double began_s = options_.clock->NowS();
      if (!stream_->Grab()) return false;
      const double came_s = options_.clock->NowS();
      bool decode;
      {
        std::lock_guard<std::mutex> lock(mutex_);
        ++frames_;
        why_.clear();
        // One that we began to wait for after that moment was exposed after it.
        const bool fresh = began_s >= wanted_after_s_ &&
                           (came_s - began_s >= kWaitS || began_s >= wanted_after_s_ + kDrainS);
        decode = last_.empty() || (wanted_ && fresh);
        if (wanted_ && !fresh) ++stale_frames_;
      }
      cv::Mat picture;
      if (!decode) return true;
      if (const absl::Status whole = stream_->Retrieve(&picture); !whole.ok()) {
        std::lock_guard<std::mutex> lock(mutex_);
        ++damaged_;
        damage_ = std::string(whole.message());
        return true;
      }
      const bool first = last_.empty();
      const bool same = !first && picture.size() == last_.size() && picture.type() == last_.type() &&
                        picture.isContinuous() &&
                        std::memcmp(picture.data, last_.data, picture.total() * picture.elemSize()) == 0;
      picture.copyTo(last_);
      std::unique_lock<std::mutex> lock(mutex_);
      if (same) {
        ++stale_frames_;
        repeated_ = true;
      } else if (!first && wanted_ && !has_result_ && began_s >= wanted_after_s_) {
        result_ = FrameOf(picture, came_s - options_.latency_s, frames_);
        has_result_ = true;
        lock.unlock();
        changed_.notify_all();
      }
      return true;
    } catch (const cv::Exception&) {
      return false;
    }
  }

  const CameraOptions options_;
  std::thread thread_;
  const std::unique_ptr<PictureStream> stream_;  // of the thread, once it runs
  cv::Mat last_;                                 // what was decoded last

  std::mutex take_mutex_;     // one Take at a time
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool stopping_ = false;
  bool wanted_ = false, has_result_ = false, repeated_ = false;
  double wanted_after_s_ = 0;
  image::Frame result_;
  std::string why_;
  int damaged_ = 0;     // pictures that were not whole, since somebody waits
  std::string damage_;  // of the last one
  uint64_t frames_ = 0, stale_frames_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CameraDevice>> OpenStreamCamera(const CameraOptions& options) {
  return OpenStreamCamera(options, std::make_unique<OpenCvStream>(options));
}

absl::StatusOr<std::unique_ptr<CameraDevice>> OpenStreamCamera(const CameraOptions& options,
                                                               std::unique_ptr<PictureStream> stream) {
  auto camera = std::make_unique<StreamCamera>(options, std::move(stream));
  if (absl::Status status = camera->Start(); !status.ok()) return status;
  return camera;
}

}  // namespace touchstone::gateway::camera
