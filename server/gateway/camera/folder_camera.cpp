#include <algorithm>
#include <filesystem>
#include <mutex>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <sys/stat.h>
#include <opencv2/core.hpp>

#include "server/base/text/text.h"
#include "server/gateway/camera/camera_kinds.h"

namespace touchstone::gateway::camera {
namespace {

constexpr double kCoarseS = 0.01;  // file systems stamp with the kernel's slow clock
constexpr double kLookS = 0.02;
constexpr uint64_t kMaxFileBytes = uint64_t{256} << 20;

bool IsPicture(const std::filesystem::path& path) {
  if (path.filename().string().front() == '.') return false;
  const std::string extension = absl::AsciiStrToLower(path.extension().string());
  for (const char* known : {".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".pgm", ".tif", ".tiff"})
    if (extension == known) return true;
  return false;
}

// A file as it was written once.
struct Stamp {
  std::string path;
  double unix_s = -1e18;  // of its last change, by the clock of who keeps it; far in the past if it is gone
  bool operator==(const Stamp& other) const { return path == other.path && unix_s == other.unix_s; }
};

Stamp StampOf(const std::string& path) {
  struct stat info;
  if (path.empty() || stat(path.c_str(), &info) != 0) return {path};
  return {path, static_cast<double>(info.st_mtim.tv_sec) + 1e-9 * info.st_mtim.tv_nsec};
}

class FolderCamera : public CameraDevice {
 public:
  FolderCamera(CameraOptions options, std::string path)
      : options_(std::move(options)), path_(std::move(path)) {}

  absl::StatusOr<image::Frame> Take(double after_host_s) override {
    std::lock_guard<std::mutex> lock(mutex_);
    const Clock& clock = *options_.clock;
    const double until_s = clock.NowS() + options_.timeout_s + options_.latency_s;
    while (true) {
      const std::string name = Newest();
      std::string why = "it has no picture";
      if (!name.empty()) {
        const Stamp stamp = StampOf(name);
        const double ahead_s = stamp.unix_s - clock.UnixNowS(), changed_s = clock.NowS() + ahead_s;
        if (ahead_s > kCoarseS) of_the_future_ = stamp;
        if (stamp == of_the_future_) {
          why = absl::StrCat(
              "its newest picture, ", std::filesystem::path(name).filename().string(),
              ", was written at a time that had not come yet: a clock was set back, or the folder's is "
              "ahead, so how old it is cannot be known");
        } else if (changed_s + kCoarseS < after_host_s + options_.latency_s) {
          why = absl::StrCat("its newest picture, ", std::filesystem::path(name).filename().string(),
                             ", is older than asked for");
        } else {
          const absl::StatusOr<std::string> bytes = ReadFile(name, kMaxFileBytes);
          const absl::StatusOr<cv::Mat> picture = bytes.ok() ? DecodeWhole(*bytes) : bytes.status();
          if (picture.ok()) return FrameOf(*picture, changed_s - options_.latency_s, ++frames_);
          why = absl::StrCat(std::filesystem::path(name).filename().string(),
                             " cannot be read: ", picture.status().message());
        }
      }
      if (clock.NowS() >= until_s)
        return absl::UnavailableError(
            absl::StrCat("camera folder ", path_, ": no picture in ", options_.timeout_s, " s: ", why));
      clock.SleepFor(kLookS);
    }
  }
  CameraKind kind() const override { return CameraKind::kFolder; }
  std::string Description() const override { return absl::StrCat("pictures in ", path_); }
  uint64_t frames() const override { return Locked(frames_); }
  uint64_t stale_frames() const override { return 0; }

 private:
  uint64_t Locked(const uint64_t& value) const {
    std::lock_guard<std::mutex> lock(mutex_);
    return value;
  }
  std::string Newest() const {
    std::string newest;
    std::error_code error;
    for (std::filesystem::directory_iterator i(path_, error), end; !error && i != end; i.increment(error))
      if (IsPicture(i->path())) newest = std::max(newest, i->path().string());
    return newest;
  }

  const CameraOptions options_;
  const std::string path_;
  mutable std::mutex mutex_;
  Stamp of_the_future_;  // remembered, since its time comes while one waits
  uint64_t frames_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CameraDevice>> OpenFolderCamera(const CameraOptions& options,
                                                               const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error))
    return absl::NotFoundError(absl::StrCat("camera: ", path, " is no folder"));
  return std::make_unique<FolderCamera>(options, path);
}

}  // namespace touchstone::gateway::camera
