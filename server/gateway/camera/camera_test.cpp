#include "server/gateway/camera/camera.h"

#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "server/base/test_folder.h"
#include "server/gateway/camera/mjpeg_server.h"

namespace touchstone::gateway::camera {
namespace {

using testing::HasSubstr;

class CameraTest : public testing::Test {
 protected:
  // A picture all of one grey.
  void Write(const std::string& name, int grey) const {
    cv::imwrite(folder_ + "/" + name, cv::Mat(12, 16, CV_8UC3, cv::Scalar(grey, grey, grey)));
  }
  static CameraOptions Options(const std::string& uri, double timeout_s = 20) {
    CameraOptions options;
    options.uri = uri;
    options.timeout_s = timeout_s;
    return options;
  }
  static std::unique_ptr<CameraDevice> Open(const CameraOptions& options) {
    absl::StatusOr<std::unique_ptr<CameraDevice>> camera = CameraDevice::Open(options);
    EXPECT_TRUE(camera.ok()) << camera.status();
    return camera.ok() ? *std::move(camera) : nullptr;
  }
  static int SceneOf(const image::Frame& frame) {
    return MjpegServer::SceneOf(frame.rgb.data(), frame.width, frame.height);
  }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
};

TEST(CameraKind, IsThatOfItsAddress) {
  EXPECT_EQ(CameraKindOf(""), CameraKind::kNone);
  EXPECT_EQ(CameraKindOf("0"), CameraKind::kUvc);
  EXPECT_EQ(CameraKindOf("/dev/video0"), CameraKind::kUvc);
  EXPECT_EQ(CameraKindOf("http://127.0.0.1:8080/"), CameraKind::kStream);
  EXPECT_EQ(CameraKindOf("folder:/tmp/a:b"), CameraKind::kFolder);
  EXPECT_EQ(CameraKindOf("video:a.mp4"), CameraKind::kVideo);
}

TEST_F(CameraTest, RefusesASourceThatIsNot) {
  const auto error = [](const std::string& source) {
    return CameraDevice::Open(Options(source, 1)).status();
  };
  EXPECT_TRUE(absl::IsFailedPrecondition(error("")));
  EXPECT_THAT(std::string(error("folder:" + folder_ + "/no").message()), HasSubstr("is no folder"));
  EXPECT_THAT(std::string(error("video:" + folder_ + "/no.avi").message()), HasSubstr("there is no video"));
  Write("not_a_video.txt.png", 1);
  EXPECT_THAT(std::string(error(folder_ + "/no_device").message()), HasSubstr("cannot be opened"));
  CameraOptions options = Options("folder:" + folder_);
  options.timeout_s = 0;
  EXPECT_THAT(std::string(CameraDevice::Open(options).status().message()), HasSubstr("timeout_s is 0"));
}

TEST_F(CameraTest, TakesTheNewestPictureOfAFolder) {
  Write("b.png", 20);
  Write("a.png", 10);
  Write("c.txt.png", 30);
  std::filesystem::rename(folder_ + "/c.txt.png", folder_ + "/c.txt");
  Write(".d.png", 40);
  const auto camera = Open(Options("folder:" + folder_));
  ASSERT_NE(camera, nullptr);
  const absl::StatusOr<image::Frame> frame = camera->Take(0);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->width, 16);
  EXPECT_EQ(frame->height, 12);
  EXPECT_EQ(frame->rgb.at(0), 20);
  // Equal pictures are legitimate.
  EXPECT_TRUE(camera->Take(0).ok());
  EXPECT_EQ(camera->frames(), 2u);
}

TEST_F(CameraTest, WaitsForAPictureThatIsNewEnough) {
  Write("a.png", 10);
  const auto camera = Open(Options("folder:" + folder_));
  ASSERT_NE(camera, nullptr);
  const double after_s = timing::HostNowS() + 0.1;
  std::thread writer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    Write(".part.png", 50);
    std::filesystem::rename(folder_ + "/.part.png", folder_ + "/b.png");
  });
  const absl::StatusOr<image::Frame> frame = camera->Take(after_s);
  writer.join();
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->rgb.at(0), 50);
  EXPECT_GE(frame->host_time_s, after_s - 0.02);
}

TEST_F(CameraTest, SaysWhyAFolderGivesNothing) {
  const auto camera = Open(Options("folder:" + folder_, 0.05));
  ASSERT_NE(camera, nullptr);
  EXPECT_THAT(std::string(camera->Take(0).status().message()), HasSubstr("it has no picture"));
  Write("a.png", 10);
  const absl::Status old = camera->Take(timing::HostNowS() + 100).status();
  EXPECT_TRUE(absl::IsUnavailable(old)) << old;
  EXPECT_THAT(std::string(old.message()), HasSubstr("a.png, is older than asked for"));
}

TEST_F(CameraTest, TakesNoPictureWhoseAgeAClockHides) {
  const auto camera = Open(Options("folder:" + folder_, 0.5));
  ASSERT_NE(camera, nullptr);
  Write("a.png", 10);
  // As after the clock was set back: by an hour, or by less than one waits for a picture.
  for (const std::chrono::milliseconds ahead :
       {std::chrono::milliseconds(3'600'000), std::chrono::milliseconds(250)}) {
    std::filesystem::last_write_time(folder_ + "/a.png",
                                     std::filesystem::file_time_type::clock::now() + ahead);
    const absl::Status status = camera->Take(timing::HostNowS()).status();
    EXPECT_TRUE(absl::IsUnavailable(status)) << status;
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("a.png, was written at a time that had not come yet"));
  }
  Write("b.png", 50);
  const absl::StatusOr<image::Frame> frame = camera->Take(0);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->rgb.at(0), 50);
}

TEST_F(CameraTest, PlaysAVideoAndBeginsItAnew) {
  const std::string path = folder_ + "/film.avi";
  {
    cv::VideoWriter writer(path, cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25,
                           cv::Size(64, 48));
    ASSERT_TRUE(writer.isOpened());
    for (const int grey : {50, 100, 150})
      writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar(grey, grey, grey)));
  }
  const auto camera = Open(Options("video:" + path));
  ASSERT_NE(camera, nullptr);
  for (const int grey : {50, 100, 150, 50}) {
    const absl::StatusOr<image::Frame> frame = camera->Take(0);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->width, 64);
    EXPECT_NEAR(frame->rgb.at(1000), grey, 4);
  }
}

TEST_F(CameraTest, TakesAPictureOfAfterNotOfBefore) {
  MjpegServer server;
  const auto camera = Open(Options(server.Url()));
  ASSERT_NE(camera, nullptr);
  for (int scene = 0; scene < 8; ++scene) {
    server.scene = scene;
    // A picture whose making had begun when the scene changed may still be on its way.
    const double after_s = timing::HostNowS() + 0.5;
    const absl::StatusOr<image::Frame> frame = camera->Take(after_s);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(SceneOf(*frame), scene);
    EXPECT_GE(frame->host_time_s, after_s);
  }
  EXPECT_GT(camera->stale_frames(), 0u);
}

TEST_F(CameraTest, NoticesAFrozenCamera) {
  MjpegServer server;
  const auto camera = Open(Options(server.Url(), 3));
  ASSERT_NE(camera, nullptr);
  ASSERT_TRUE(camera->Take(0).ok());
  server.frozen = true;
  (void)camera->Take(timing::HostNowS() + 0.2);  // the first of the equal pictures may be new
  const absl::Status frozen = camera->Take(timing::HostNowS()).status();
  EXPECT_TRUE(absl::IsDataLoss(frozen)) << frozen;
  EXPECT_THAT(std::string(frozen.message()), HasSubstr("repeats one picture bit by bit"));
  server.frozen = false;
  absl::StatusOr<image::Frame> frame = camera->Take(timing::HostNowS());
  for (int i = 0; i < 5 && !frame.ok(); ++i) frame = camera->Take(timing::HostNowS());
  EXPECT_TRUE(frame.ok()) << frame.status();
}

TEST_F(CameraTest, ComesBackAfterTheStreamWasCut) {
  auto server = std::make_unique<MjpegServer>();
  const int port = server->port();
  const auto camera = Open(Options(server->Url(), 2));
  ASSERT_NE(camera, nullptr);
  ASSERT_TRUE(camera->Take(0).ok());
  server.reset();
  const absl::Status gone = camera->Take(timing::HostNowS() + 0.5).status();
  EXPECT_TRUE(absl::IsUnavailable(gone)) << gone;
  server = std::make_unique<MjpegServer>(port);
  absl::StatusOr<image::Frame> frame = camera->Take(timing::HostNowS());
  for (int i = 0; i < 10 && !frame.ok(); ++i) frame = camera->Take(timing::HostNowS());
  EXPECT_TRUE(frame.ok()) << frame.status();
}

TEST_F(CameraTest, TimesOutWhenNothingComes) {
  MjpegServer server;
  const auto camera = Open(Options(server.Url(), 1));
  ASSERT_NE(camera, nullptr);
  ASSERT_TRUE(camera->Take(0).ok());
  server.silent = true;
  const absl::Status silent = camera->Take(timing::HostNowS() + 0.5).status();
  EXPECT_TRUE(absl::IsUnavailable(silent)) << silent;
}

}  // namespace
}  // namespace touchstone::gateway::camera
