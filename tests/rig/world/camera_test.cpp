#include "tests/rig/world/camera.h"

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <turbojpeg.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <numeric>

#include "server/geometry/shapes/supershape.h"
#include "tests/rig/controller/network/net.h"

namespace touchstone::rig {
namespace {

// A connection on which a path was asked for.
int Ask(int port, const std::string& path) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in where{};
  where.sin_family = AF_INET, where.sin_port = htons(static_cast<uint16_t>(port));
  inet_pton(AF_INET, "127.0.0.1", &where.sin_addr);
  EXPECT_EQ(connect(fd, reinterpret_cast<sockaddr*>(&where), sizeof where), 0);
  const std::string request = "GET " + path + " HTTP/1.1\r\nHost: x\r\n\r\n";
  EXPECT_EQ(send(fd, request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
  return fd;
}

// What an HTTP client reads of a path, up to so many bytes or the end.
std::string Get(int port, const std::string& path, size_t most = 1 << 22) {
  const int fd = Ask(port, path);
  std::string all;
  char bytes[4096];
  for (ssize_t got; all.size() < most && (got = recv(fd, bytes, sizeof bytes, 0)) > 0;)
    all.append(bytes, got);
  close(fd);
  return all;
}

std::string Body(const std::string& response) {
  const size_t head = response.find("\r\n\r\n");
  return head == std::string::npos ? "" : response.substr(head + 4);
}

// Reads up to and with these bytes; what came before them.
std::string ReadUpTo(int fd, const std::string& end) {
  std::string all;
  for (char c; all.size() < end.size() || all.compare(all.size() - end.size(), end.size(), end) != 0;
       all += c)
    if (recv(fd, &c, 1, 0) != 1) return "";
  return all.substr(0, all.size() - end.size());
}

// Grey levels of a JPEG; empty if it is none.
std::vector<uint8_t> Decode(const std::string& jpeg, int* width, int* height) {
  tjhandle handle = tjInitDecompress();
  const auto* bytes = reinterpret_cast<const unsigned char*>(jpeg.data());
  int sampling, space;
  std::vector<uint8_t> grey;
  if (tjDecompressHeader3(handle, bytes, jpeg.size(), width, height, &sampling, &space) == 0) {
    grey.resize(static_cast<size_t>(*width) * *height);
    tjDecompress2(handle, bytes, jpeg.size(), grey.data(), *width, 0, *height, TJPF_GRAY, 0);
  }
  tjDestroy(handle);
  return grey;
}

class EmulatedCameraTest : public testing::Test {
 protected:
  EmulatedCameraTest() {
    surface_ = geometry::Surface::Create(
                   "lat20", geometry::MakeSupershape(*geometry::NamedSupershape("lat20"), 2000).value())
                   .value();
    camera_ = std::make_unique<EmulatedCamera>(
        CameraOptions(),
        [this] {
          looked_s_ = clock_.NowS();
          CameraView view;
          view.surface = surface_;
          // From 0.4 m above, looking down.
          view.mesh_from_camera.translation() = Eigen::Vector3d(0, 0, 0.4);
          view.mesh_from_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix();
          return view;
        },
        &clock_, &faults_);
  }
  // Until the clock is there; a busy machine may take its time.
  void AwaitTime(double sim_s) {
    const double until_s = HostNowS() + 60;
    while (clock_.NowS() < sim_s) ASSERT_LT(HostNowS(), until_s);
  }

  SimClock clock_{1000};
  std::atomic<double> looked_s_{0};
  Faults faults_;
  std::shared_ptr<const geometry::Surface> surface_;
  std::unique_ptr<EmulatedCamera> camera_;
};

TEST_F(EmulatedCameraTest, ShowsALitObjectOnADarkGround) {
  int width = 0, height = 0;
  const auto grey = Decode(Body(Get(camera_->port(), "/frame.jpg")), &width, &height);
  ASSERT_EQ(width, 640);
  ASSERT_EQ(height, 480);
  EXPECT_GT(grey[240 * 640 + 320], 80);
  EXPECT_LT(grey[10 * 640 + 10], 40);
}

TEST_F(EmulatedCameraTest, NeverSendsTheSamePictureTwiceUnlessItIsStale) {
  const std::string first = Body(Get(camera_->port(), "/frame.jpg")),
                    second = Body(Get(camera_->port(), "/frame.jpg"));
  EXPECT_NE(first, second);
  faults_.Set("stale_frame", 1);
  const std::string third = Body(Get(camera_->port(), "/frame.jpg")),
                    fourth = Body(Get(camera_->port(), "/frame.jpg"));
  EXPECT_EQ(third, fourth);
  EXPECT_FALSE(third.empty());
}

TEST_F(EmulatedCameraTest, StreamsPictureAfterPicture) {
  const std::string stream = Get(camera_->port(), "/video.mjpg", 120'000);
  EXPECT_NE(stream.find("multipart/x-mixed-replace"), std::string::npos);
  size_t parts = 0;
  for (size_t at = 0; (at = stream.find("Content-Type: image/jpeg", at)) != std::string::npos; ++at) ++parts;
  EXPECT_GE(parts, 2u);
  EXPECT_NE(Get(camera_->port(), "/else").find("404"), std::string::npos);
}

TEST_F(EmulatedCameraTest, LetsTimeStandFromAnExposureUntilThePictureWasRead) {
  const int fd = Ask(camera_->port(), "/video.mjpg");
  const double period_s = clock_.speedup() / CameraOptions().frames_per_host_s;
  double before_s = 0;
  for (int k = 0; k < 3; ++k) {
    ReadUpTo(fd, "Content-Length: ");
    const int bytes = std::atoi(ReadUpTo(fd, "\r\n\r\n").c_str());
    ASSERT_GT(bytes, 1000);
    const double looked_s = looked_s_;
    EXPECT_NEAR(clock_.NowS(), looked_s, 1e-6) << k;
    if (k > 0) {
      EXPECT_NEAR(looked_s - before_s, period_s, 1e-6) << k;
    }
    before_s = looked_s;
    std::string picture(bytes + 2, 0);
    ASSERT_EQ(recv(fd, picture.data(), picture.size(), MSG_WAITALL), static_cast<ssize_t>(picture.size()));
    AwaitTime(looked_s + 0.1 * period_s);
  }
  // Who has left without reading is not waited for.
  ReadUpTo(fd, "Content-Length: ");
  close(fd);
  AwaitTime(before_s + 3 * period_s);
}

TEST_F(EmulatedCameraTest, IsGoneWhileItIsUnplugged) {
  faults_.Set("camera_unplug", 3600);
  EXPECT_EQ(Get(camera_->port(), "/frame.jpg"), "");
  faults_.Set("camera_unplug", 0);
  EXPECT_NE(Body(Get(camera_->port(), "/frame.jpg")), "");
}

}  // namespace
}  // namespace touchstone::rig
