#include "server/gateway/camera/mjpeg_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "server/base/check.h"

namespace touchstone::gateway::camera {
namespace {

constexpr int kWidth = 128, kHeight = 96;

bool SendAll(int socket, const void* data, size_t size) {
  const char* bytes = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t sent = send(socket, bytes, size, MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes += sent;
    size -= static_cast<size_t>(sent);
  }
  return true;
}

}  // namespace

MjpegServer::MjpegServer(int port) {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int on = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  TOUCHSTONE_CHECK(bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
  TOUCHSTONE_CHECK(listen(listener_, 4) == 0);
  socklen_t size = sizeof address;
  TOUCHSTONE_CHECK(getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) == 0);
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { Run(); });
}

MjpegServer::~MjpegServer() {
  stopping_ = true;
  thread_.join();
  close(listener_);
}

int MjpegServer::SceneOf(const uint8_t* rgb, int width, int height) {
  std::vector<double> columns(8);
  for (int x = 0; x < width; ++x)
    for (int y = 0; y < height; ++y) columns[x * 8 / width] += rgb[3 * (y * width + x) + 1];
  int brightest = 0;
  for (int i = 0; i < 8; ++i)
    if (columns[i] > columns[brightest]) brightest = i;
  return brightest;
}

void MjpegServer::Run() {
  while (!stopping_) {
    pollfd waiting{listener_, POLLIN, 0};
    if (poll(&waiting, 1, 20) <= 0) continue;
    const int client = accept(listener_, nullptr, nullptr);
    if (client < 0) continue;
    Serve(client);
    close(client);
  }
}

void MjpegServer::Serve(int client) {
  char request[2048];
  (void)!recv(client, request, sizeof request, 0);
  const std::string head =
      "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=next\r\n\r\n";
  if (!SendAll(client, head.data(), head.size())) return;
  cv::RNG noise(5);
  std::vector<uint8_t> jpeg;
  while (!stopping_) {
    if (jpeg.empty() || !frozen) {
      cv::Mat picture(kHeight, kWidth, CV_8UC3);
      noise.fill(picture, cv::RNG::UNIFORM, 0, 60);
      picture(cv::Rect(scene * kWidth / 8, 0, kWidth / 8, kHeight)) += cv::Scalar(180, 180, 180);
      cv::imencode(".jpg", picture, jpeg);
    }
    if (!silent) {
      jpeg.resize(static_cast<size_t>(share * static_cast<double>(jpeg.size())));
      const std::string part =
          "--next\r\nContent-Type: image/jpeg\r\nContent-Length: " + std::to_string(jpeg.size()) + "\r\n\r\n";
      if (!SendAll(client, part.data(), part.size()) || !SendAll(client, jpeg.data(), jpeg.size()) ||
          !SendAll(client, "\r\n", 2))
        return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(25));
  }
}

}  // namespace touchstone::gateway::camera
