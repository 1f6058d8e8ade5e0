#include "tests/rig/world/camera.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "server/image/encoding/encode.h"
#include "tests/rig/controller/network/unread.h"

namespace touchstone::rig {
namespace {

constexpr int kGroundLevel = 14, kNoiseLevels = 5;
constexpr double kLookAheadM = 0.2;
constexpr double kAskAgainS = 2e-4;  // whether others are done and viewers have read, host time
constexpr char kBoundary[] = "touchstone-emulated-frame";

}  // namespace

// Registered as long as it lives.
class EmulatedCamera::Viewer {
 public:
  Viewer(EmulatedCamera* camera, int the_fd) : fd(the_fd), camera_(camera) {
    std::lock_guard<std::mutex> lock(camera_->mutex_);
    sent = camera_->number_;
    camera_->viewers_.push_back(this);
    camera_->changed_.notify_all();
  }
  ~Viewer() {
    std::lock_guard<std::mutex> lock(camera_->mutex_);
    auto& viewers = camera_->viewers_;
    viewers.erase(std::find(viewers.begin(), viewers.end(), this));
    camera_->changed_.notify_all();
  }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  const int fd;
  // The rest with the camera's mutex_.
  uint64_t sent;  // number of the picture that it was sent last, or of the one before it came
  ReaderPatience patience;

 private:
  EmulatedCamera* const camera_;
};

EmulatedCamera::EmulatedCamera(const CameraOptions& options, std::function<CameraView()> look,
                               SimClock* clock, const Faults* faults)
    : options_(options), look_(std::move(look)), clock_(clock), faults_(faults), random_(options.seed) {
  auto renderer = image::CreateCpuRenderer();
  if (!renderer.ok()) throw std::runtime_error(std::string(renderer.status().message()));
  renderer_ = *renderer;
  server_ = std::make_unique<TcpServer>(options.address, options.port,
                                        [this](LineConnection& connection) { Serve(connection); });
  thread_ = std::thread([this] { Run(); });
}

EmulatedCamera::~EmulatedCamera() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
  server_.reset();
}

uint64_t EmulatedCamera::frames() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return rendered_;
}

Light EmulatedCamera::SeenThroughLens(const CameraView& view) {
  const double ground = options_.hidden.ground_grey.value_or(0) / 255;
  if (view.surface && (!light_ || light_->surface() != view.surface))
    light_ = std::make_unique<CameraLight>(view.surface);
  return ThroughLens(options_.hidden, options_.width, options_.height, options_.vertical_fov_rad,
                     [&](const std::vector<Eigen::Vector2d>& rays) {
                       if (!view.surface) return std::vector<double>(rays.size(), ground);
                       return light_->Along(rays, RealPose(options_.hidden, view.mesh_from_camera),
                                            view.mesh_from_camera, ground);
                     });
}

Light EmulatedCamera::SeenByPinhole(const CameraView& view) {
  Light light{options_.width, options_.height,
              std::vector<double>(static_cast<size_t>(options_.width) * options_.height, 0)};
  if (!view.surface) return light;
  image::Camera camera;
  camera.eye_m = view.mesh_from_camera.translation();
  const Eigen::Vector3d ahead = view.mesh_from_camera.linear().col(2).normalized();
  camera.at_m = camera.eye_m + ahead * kLookAheadM;
  camera.up = -view.mesh_from_camera.linear().col(1);
  camera.vertical_fov_rad = options_.vertical_fov_rad;
  image::ImageOptions image;
  image.width = options_.width, image.height = options_.height;
  // An object that is not before the camera at all gives no picture, but a dark one.
  if (const auto rendered = renderer_->Render(view.surface, camera, image); rendered.ok())
    for (size_t k = 0; k < light.level.size(); ++k) light.level[k] = rendered->pixels[k] / 255.0;
  return light;
}

std::string EmulatedCamera::Picture() {
  const CameraView view = look_();
  Light light = options_.anything_hidden ? SeenThroughLens(view) : SeenByPinhole(view);
  Develop(options_.hidden, &light);
  std::vector<uint8_t> pixels;
  if (options_.hidden.sigma_grey) {
    pixels = Record(options_.hidden, light, &random_);
  } else {
    const int ground = options_.hidden.ground_grey ? 0 : kGroundLevel;
    for (const double lit : light.level) {
      const int noise = static_cast<int>(random_() % (2 * kNoiseLevels + 1)) - kNoiseLevels;
      const int level = std::max(static_cast<int>(std::lround(255 * lit)), ground);
      pixels.push_back(static_cast<uint8_t>(std::clamp(level + noise, 0, 255)));
    }
  }
  auto jpeg = image::EncodeJpeg(pixels.data(), options_.width, options_.height, 1, options_.jpeg_quality);
  return jpeg.ok() ? *jpeg : std::string();
}

void EmulatedCamera::Run() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stopping_ || !viewers_.empty(); });
    if (stopping_) return;
    TakePictures(lock);
  }
}

void EmulatedCamera::TakePictures(std::unique_lock<std::mutex>& lock) {
  const auto wait = [&](double host_s) {
    changed_.wait_for(lock, std::chrono::duration<double>(std::max(host_s, kAskAgainS)));
    return !stopping_ && !viewers_.empty();
  };
  const double ahead_s = SimClock::kAheadHostS * clock_->speedup();
  const double period_s = clock_->speedup() / options_.frames_per_host_s;
  SimClock::Part part(clock_, [] {});
  for (double exposure_s = clock_->NowS() + ahead_s;; exposure_s += period_s) {
    part.Done(exposure_s - ahead_s);
    while (!part.OthersDone(exposure_s))
      if (!wait((exposure_s - clock_->NowS()) / clock_->speedup())) return;
    Expose(lock);
    while (!ReadByAll())
      if (!wait(0)) return;
  }
}

void EmulatedCamera::Expose(std::unique_lock<std::mutex>& lock) {
  const bool stale = faults_->Get("stale_frame") > 0 && !jpeg_.empty();
  if (!stale) {
    lock.unlock();
    std::string jpeg = Picture();
    lock.lock();
    jpeg_ = std::move(jpeg), ++rendered_;
  }
  ++number_;
  changed_.notify_all();
}

bool EmulatedCamera::ReadByAll() {
  bool all = true;
  for (Viewer* viewer : viewers_) {
    const size_t unread = UnreadOrUnderway(viewer->fd);
    // One that has read everything is about to be sent more by a thread of our own.
    if (viewer->patience.WaitsFor(unread) || (unread == 0 && viewer->sent < number_)) all = false;
  }
  return all;
}

bool EmulatedCamera::SendNext(LineConnection& connection, Viewer* viewer, const std::string& head,
                              const std::string& tail) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return stopping_ || number_ > viewer->sent; });
  if (stopping_ || faults_->UntilHostS("camera_unplug") > 0) return false;
  const std::string jpeg = jpeg_;
  const uint64_t number = number_;
  lock.unlock();
  const bool sent = connection.Send(head + std::to_string(jpeg.size()) + "\r\n\r\n" + jpeg + tail);
  lock.lock();
  viewer->sent = number;
  changed_.notify_all();
  return sent;
}

void EmulatedCamera::Serve(LineConnection& connection) {
  if (faults_->UntilHostS("camera_unplug") > 0) return;
  std::string request, line;
  if (!connection.ReadLine(&request)) return;
  while (connection.ReadLine(&line) && !line.empty()) {
  }
  if (request.rfind("GET /frame.jpg", 0) == 0) {
    Viewer viewer(this, connection.fd());
    SendNext(
        connection, &viewer,
        "HTTP/1.0 200 OK\r\nContent-Type: image/jpeg\r\nX-Source: emulated camera\r\nConnection: close\r\n"
        "Content-Length: ",
        "");
  } else if (request.rfind("GET /video.mjpg", 0) == 0) {
    Viewer viewer(this, connection.fd());
    bool open = connection.Send(
        std::string(
            "HTTP/1.0 200 OK\r\nX-Source: emulated camera\r\nConnection: close\r\nCache-Control: no-cache\r\n"
            "Content-Type: multipart/x-mixed-replace; boundary=") +
        kBoundary + "\r\n\r\n");
    while (open)
      open = SendNext(
          connection, &viewer,
          std::string("--") + kBoundary + "\r\nContent-Type: image/jpeg\r\nContent-Length: ", "\r\n");
  } else {
    connection.Send(
        "HTTP/1.0 404 Not Found\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\n"
        "This emulated camera has /video.mjpg and /frame.jpg.\n");
  }
}

}  // namespace touchstone::rig
