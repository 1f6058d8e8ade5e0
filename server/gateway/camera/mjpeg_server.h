// A camera over HTTP as cheap network cameras are: multipart JPEG pictures. A test tool.
#pragma once

#include <atomic>
#include <string>
#include <thread>

namespace touchstone::gateway::camera {

// Serves one client at a time at 127.0.0.1. Every picture is a bright square on noise; the square's column
// reports the value of `scene` at the time.
class MjpegServer {
 public:
  explicit MjpegServer(int port = 0);
  ~MjpegServer();
  int port() const { return port_; }
  std::string Url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/"; }

  std::atomic<int> scene{0};        // 0 to 7: where the square is
  std::atomic<bool> frozen{false};  // sends one picture again and again
  std::atomic<bool> silent{false};  // sends nothing
  std::atomic<double> share{1};     // of every picture's bytes that is sent
  static int SceneOf(const uint8_t* rgb, int width, int height);

 private:
  void Run();
  void Serve(int client);

  int listener_ = -1;
  int port_ = 0;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace touchstone::gateway::camera
