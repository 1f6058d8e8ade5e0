// The emulated camera, carried by the flange: pictures of the mounted object from where the arm truly is, as
// MJPEG over HTTP ("/video.mjpg") and one by one ("/frame.jpg"). A plain matt object on a dark ground with a
// little noise, so that no two pictures are equal, seen as hidden_camera.h says; not a likeness of any real camera.
//
// Time stands from the exposure of a picture until whoever watches has read it. So a picture that somebody began to
// wait for at a time of the rig's clock shows the arm at that time or later, however busy the machine is.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Geometry>

#include "server/geometry/surface/surface.h"
#include "server/image/renderers/renderer.h"
#include "tests/rig/world.h"
#include "tests/rig/world/camera_light.h"
#include "tests/rig/world/hidden_camera.h"
#include "tests/rig/world/tcp_server.h"

namespace touchstone::rig {

struct CameraOptions {
  std::string address = "127.0.0.1";
  int port = 0;
  int width = 640, height = 480;
  double vertical_fov_rad = 0.7853981633974483;
  double frames_per_host_s = 10;  // of the clock's HostS()
  int jpeg_quality = 90;
  uint64_t seed = 1;
  HiddenCamera hidden;
  bool anything_hidden = false;  // among `hidden`
};

// What is before the camera now.
struct CameraView {
  std::shared_ptr<const geometry::Surface> surface;                // none: nothing is mounted
  Eigen::Affine3d mesh_from_camera = Eigen::Affine3d::Identity();  // z looks ahead, y down
};

class EmulatedCamera {
 public:
  // `look` is asked for every picture, from the camera's thread, while the clock stands. That must not be a manual one.
  // Faults: stale_frame, camera_unplug. Throws std::runtime_error.
  EmulatedCamera(const CameraOptions& options, std::function<CameraView()> look, SimClock* clock,
                 const Faults* faults);
  ~EmulatedCamera();

  int port() const { return server_->port(); }
  uint64_t frames() const;  // rendered so far: none while nobody watches

 private:
  class Viewer;  // a connection that pictures are sent to

  void Run();
  // While somebody watches and it does not end.
  void TakePictures(std::unique_lock<std::mutex>& lock);
  void Expose(std::unique_lock<std::mutex>& lock);
  bool ReadByAll();  // the newest picture
  std::string Picture();
  // As hidden_camera.h says, and as the plain pinhole that it is if nothing is hidden.
  Light SeenThroughLens(const CameraView& view);
  Light SeenByPinhole(const CameraView& view);
  void Serve(LineConnection& connection);
  // Sends the first picture that this viewer has not been sent, with its size after `head`. False: the connection is
  // closed, or must be, since the camera ends or is unplugged.
  bool SendNext(LineConnection& connection, Viewer* viewer, const std::string& head, const std::string& tail);

  const CameraOptions options_;
  const std::function<CameraView()> look_;
  SimClock* const clock_;
  const Faults* const faults_;
  std::shared_ptr<image::Renderer> renderer_;
  std::unique_ptr<CameraLight> light_;  // of the surface that was seen last
  std::mt19937_64 random_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::string jpeg_;
  uint64_t number_ = 0, rendered_ = 0;
  std::vector<Viewer*> viewers_;
  bool stopping_ = false;
  std::thread thread_;
  std::unique_ptr<TcpServer> server_;
};

}  // namespace touchstone::rig
