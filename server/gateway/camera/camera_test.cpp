#include "server/gateway/camera/camera.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "server/base/test_folder.h"
#include "server/base/test_tier.h"
#include "server/base/threads/manual_clock.h"
#include "server/gateway/camera/fake_stream.h"
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
  CameraOptions AtClock(CameraOptions options) const {
    options.clock = &clock_;
    return options;
  }
  // By the clock of the test.
  void WriteNow(const std::string& name, int grey) const { WriteAt(name, grey, clock_.UnixNowS()); }
  void WriteAt(const std::string& name, int grey, double unix_s) const {
    const std::string part = folder_ + "/.written.png", path = folder_ + "/" + name;
    cv::imwrite(part, cv::Mat(12, 16, CV_8UC3, cv::Scalar(grey, grey, grey)));
    Stamp(part, unix_s);
    std::filesystem::rename(part, path);
  }
  static void Stamp(const std::string& path, double unix_s) {
    timespec times[2];
    times[0] = times[1] = {static_cast<time_t>(unix_s), std::lround(1e9 * (unix_s - std::floor(unix_s)))};
    ASSERT_EQ(utimensat(AT_FDCWD, path.c_str(), times, 0), 0);
  }
  // Why it gives none, once its time is over.
  absl::Status TakeInVain(CameraDevice* camera, double after_host_s) {
    auto frame = std::async(std::launch::async, [=] { return camera->Take(after_host_s); });
    clock_.AwaitWaiters();  // it has looked once
    while (frame.wait_for(std::chrono::seconds(0)) != std::future_status::ready) clock_.Advance(0.02);
    return frame.get().status();
  }
  static int SceneOf(const image::Frame& frame) {
    return MjpegServer::SceneOf(frame.rgb.data(), frame.width, frame.height);
  }

  ManualClock clock_;
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
  const auto camera = Open(AtClock(Options("folder:" + folder_)));
  ASSERT_NE(camera, nullptr);
  const double after_s = clock_.NowS() + 0.1;
  WriteNow("a.png", 10);
  auto frame = std::async(std::launch::async, [&] { return camera->Take(after_s); });
  // It looks, and waits until it looks again.
  for (const int grey : {20, 30}) {
    clock_.AdvanceToFirst();
    clock_.AwaitWaiters();
    WriteNow("b.png", grey);  // too old as well
  }
  clock_.AwaitWaiters();
  EXPECT_EQ(frame.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  WriteAt(".part.png", 50, clock_.UnixNowS() + 1);
  std::filesystem::rename(folder_ + "/.part.png", folder_ + "/c.png");
  clock_.Advance(1);
  const absl::StatusOr<image::Frame> taken = frame.get();
  ASSERT_TRUE(taken.ok()) << taken.status();
  EXPECT_EQ(taken->rgb.at(0), 50);
  EXPECT_GE(taken->host_time_s, after_s - 0.02);
}

TEST_F(CameraTest, SaysWhyAFolderGivesNothing) {
  const auto camera = Open(AtClock(Options("folder:" + folder_)));
  ASSERT_NE(camera, nullptr);
  EXPECT_THAT(std::string(TakeInVain(camera.get(), 0).message()), HasSubstr("it has no picture"));
  WriteNow("a.png", 10);
  const absl::Status old = TakeInVain(camera.get(), clock_.NowS() + 100);
  EXPECT_TRUE(absl::IsUnavailable(old)) << old;
  EXPECT_THAT(std::string(old.message()), HasSubstr("a.png, is older than asked for"));
}

TEST_F(CameraTest, TakesNoPictureWhoseAgeAClockHides) {
  const auto camera = Open(AtClock(Options("folder:" + folder_)));
  ASSERT_NE(camera, nullptr);
  // As after the clock was set back: by an hour, or by less than one waits for a picture.
  for (const double ahead_s : {3600.0, 0.25}) {
    WriteAt("a.png", 10, clock_.UnixNowS() + ahead_s);
    const absl::Status status = TakeInVain(camera.get(), clock_.NowS());
    EXPECT_TRUE(absl::IsUnavailable(status)) << status;
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("a.png, was written at a time that had not come yet"));
  }
  WriteNow("b.png", 50);
  const absl::StatusOr<image::Frame> frame = camera->Take(0);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->rgb.at(0), 50);
}

// OpenCV fills what is missing of a JPEG with grey.
TEST_F(CameraTest, TakesNoPictureOfAFolderThatIsNotWhole) {
  const auto camera = Open(AtClock(Options("folder:" + folder_)));
  ASSERT_NE(camera, nullptr);
  for (const std::string name : {"a.jpg", "b.png", "c.bmp", "d.ppm", "e.tiff"}) {
    const std::string path = folder_ + "/" + name;
    cv::Mat noise(48, 64, CV_8UC3);
    cv::RNG(5).fill(noise, cv::RNG::UNIFORM, 0, 255);
    cv::imwrite(path, noise);
    Stamp(path, clock_.UnixNowS());
    EXPECT_TRUE(camera->Take(clock_.NowS()).ok()) << name;
    std::filesystem::resize_file(path, std::filesystem::file_size(path) * 6 / 10);
    Stamp(path, clock_.UnixNowS());
    const absl::Status cut = TakeInVain(camera.get(), clock_.NowS());
    EXPECT_TRUE(absl::IsUnavailable(cut)) << name << ": " << cut;
    EXPECT_THAT(std::string(cut.message()), HasSubstr(name + " cannot be read: ")) << name;
  }
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

// --- A camera whose pictures come one after the other

class StreamCameraTest : public CameraTest {
 protected:
  static constexpr double kPeriodS = 0.04, kTimeoutS = 2;

  StreamCameraTest() {
    CameraOptions options = AtClock(Options("/dev/video0"));
    options.timeout_s = kTimeoutS;
    camera_ = *OpenStreamCamera(options, cable_.Stream());
    ShowNext(1);  // the first one is compared with nothing
  }
  ~StreamCameraTest() override { cable_.Cut(); }

  // The next picture, for which the camera waited.
  void ShowNext(int grey) {
    cable_.AwaitGrab();
    clock_.Advance(kPeriodS);
    cable_.Show(grey);
    cable_.AwaitGrab();
  }
  using Taking = std::future<absl::StatusOr<image::Frame>>;
  // Begun, so that what is shown from now on is seen by it.
  Taking Take(double after_host_s) {
    Taking taking = std::async(std::launch::async, [=] { return camera_->Take(after_host_s); });
    clock_.AwaitWaiters();
    return taking;
  }
  static bool Over(const Taking& taking) {
    return taking.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  }

  FakeCable cable_;
  std::unique_ptr<CameraDevice> camera_;
};

TEST_F(StreamCameraTest, TakesAPictureOfAfterNotOfBefore) {
  for (int scene = 10; scene < 18; ++scene) {
    const uint64_t stale = camera_->stale_frames();
    const double after_s = clock_.NowS() + 1.5 * kPeriodS;
    Taking taking = Take(after_s);
    ShowNext(100 + scene);  // exposed before
    ShowNext(200 + scene);  // its exposure may have begun before
    EXPECT_FALSE(Over(taking));
    ShowNext(scene);
    const absl::StatusOr<image::Frame> frame = taking.get();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->rgb.at(0), scene);
    EXPECT_GE(frame->host_time_s, after_s);
    EXPECT_EQ(camera_->stale_frames(), stale + 2);
  }
}

TEST_F(StreamCameraTest, TakesNoneThatStoodInAQueue) {
  const double after_s = clock_.NowS();
  Taking taking = Take(after_s);
  for (const int grey : {10, 20, 30}) {  // nobody waited for them
    cable_.Show(grey);
    cable_.AwaitGrab();
  }
  EXPECT_FALSE(Over(taking));
  EXPECT_EQ(camera_->stale_frames(), 3u);
  ShowNext(40);
  EXPECT_EQ(taking.get()->rgb.at(0), 40);
  // Half a second later a queue is empty, also where the machine is too busy to wait for any.
  clock_.Advance(1);
  cable_.Show(50);
  cable_.AwaitGrab();
  taking = Take(clock_.NowS() - 0.6);
  cable_.Show(60);
  EXPECT_EQ(taking.get()->rgb.at(0), 60);
}

TEST_F(StreamCameraTest, PassesOverDamagedPicturesAndSaysSoWhereNoneIsWhole) {
  Taking taking = Take(clock_.NowS());
  clock_.Advance(kPeriodS);
  cable_.ShowDamaged();
  ShowNext(10);
  absl::StatusOr<image::Frame> frame = taking.get();
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->rgb.at(0), 10);
  taking = Take(clock_.NowS());
  for (int i = 0; i < 3; ++i) {
    cable_.AwaitGrab();
    clock_.Advance(kPeriodS);
    cable_.ShowDamaged();
  }
  cable_.AwaitGrab();
  clock_.Advance(kTimeoutS);
  frame = taking.get();
  EXPECT_TRUE(absl::IsDataLoss(frame.status())) << frame.status();
  EXPECT_THAT(
      std::string(frame.status().message()),
      HasSubstr("no whole picture in 2 s; 3 that came were refused, the last one: JPEG: no end marker"));
}

TEST_F(StreamCameraTest, TakesNoPictureThatWasExposedBeforeAndCameLate) {
  CameraOptions options = AtClock(Options("/dev/video0", kTimeoutS));
  options.latency_s = 0.3;
  FakeCable cable;
  const auto camera = *OpenStreamCamera(options, cable.Stream());
  const auto show_next = [&](int grey) {
    cable.AwaitGrab();
    clock_.Advance(kPeriodS);
    cable.Show(grey);
    cable.AwaitGrab();
  };
  show_next(1);
  const double after_s = clock_.NowS();
  Taking taking = std::async(std::launch::async, [&] { return camera->Take(after_s); });
  clock_.AwaitWaiters();
  int grey = 10;
  for (; clock_.NowS() < after_s + options.latency_s; ++grey) show_next(grey);
  EXPECT_FALSE(Over(taking));
  show_next(grey);
  const absl::StatusOr<image::Frame> frame = taking.get();
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->rgb.at(0), grey);
  EXPECT_GE(frame->host_time_s, after_s) << "the time is that of the exposure";
  cable.Cut();
}

TEST_F(StreamCameraTest, NoticesAFrozenCamera) {
  ShowNext(7);
  EXPECT_EQ(camera_->stale_frames(), 0u);
  Taking taking = Take(clock_.NowS());
  ShowNext(8);
  ASSERT_TRUE(taking.get().ok());
  taking = Take(clock_.NowS());
  for (double passed_s = 0; passed_s < kTimeoutS - 2 * kPeriodS; passed_s += kPeriodS) ShowNext(8);
  EXPECT_FALSE(Over(taking));
  clock_.Advance(3 * kPeriodS);
  const absl::Status frozen = taking.get().status();
  EXPECT_TRUE(absl::IsDataLoss(frozen)) << frozen;
  EXPECT_THAT(std::string(frozen.message()), HasSubstr("repeats one picture bit by bit"));
  taking = Take(clock_.NowS());
  ShowNext(8), ShowNext(9);
  const absl::StatusOr<image::Frame> frame = taking.get();
  EXPECT_TRUE(frame.ok()) << frame.status();
}

TEST_F(StreamCameraTest, ComesBackAfterTheStreamWasCut) {
  cable_.Cut();
  clock_.AwaitWaiters();  // before it is opened anew
  Taking taking = std::async(std::launch::async, [&] { return camera_->Take(clock_.NowS()); });
  clock_.AwaitWaiters(2);
  while (!Over(taking)) clock_.Advance(0.1);
  const absl::Status gone = taking.get().status();
  EXPECT_TRUE(absl::IsUnavailable(gone)) << gone;
  EXPECT_THAT(std::string(gone.message()), HasSubstr("it is gone"));
  cable_.Plug();
  clock_.Advance(1);
  cable_.AwaitGrab();
  taking = Take(clock_.NowS());
  ShowNext(20), ShowNext(30);
  const absl::StatusOr<image::Frame> frame = taking.get();
  EXPECT_TRUE(frame.ok()) << frame.status();
}

TEST_F(StreamCameraTest, TimesOutWhenNothingComes) {
  Taking taking = Take(clock_.NowS() + 0.5);
  clock_.Advance(0.5 + kTimeoutS - 0.001);
  clock_.AwaitWaiters();
  EXPECT_FALSE(Over(taking)) << "of what is asked for ahead of time, the time until then does not count";
  clock_.Advance(0.001);
  const absl::Status silent = taking.get().status();
  EXPECT_TRUE(absl::IsUnavailable(silent)) << silent;
}

// --- Pictures over HTTP: the time of this machine, as FFmpeg reads it

TEST_F(CameraTest, TakesPicturesOverHttp) {
  MjpegServer server;
  server.scene = 5;
  const auto camera = Open(Options(server.Url(), 60));
  ASSERT_NE(camera, nullptr);
  const double after_s = timing::HostNowS();
  const absl::StatusOr<image::Frame> frame = camera->Take(after_s);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(SceneOf(*frame), 5);
  EXPECT_GE(frame->host_time_s, after_s);
}

// OpenCV and FFmpeg fill what is missing of a JPEG with grey.
TEST_F(CameraTest, TakesNoPictureOverHttpThatIsCutOff) {
  MjpegServer server;
  const auto camera = Open(Options(server.Url(), 0.4));
  ASSERT_NE(camera, nullptr);
  server.share = 0.6;
  const absl::Status cut = camera->Take(timing::HostNowS() + 0.1).status();
  EXPECT_TRUE(absl::IsDataLoss(cut)) << cut;
  EXPECT_THAT(std::string(cut.message()), HasSubstr("JPEG: no end marker (EOI)"));
}

class CameraOverHttpTest : public CameraTest {
 protected:
  void SetUp() override { TOUCHSTONE_SECOND_TIER("long: limits of time of a camera, of several seconds"); }
};

TEST_F(CameraOverHttpTest, TakesAPictureOfAfterNotOfBefore) {
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

TEST_F(CameraOverHttpTest, NoticesAFrozenCamera) {
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

TEST_F(CameraOverHttpTest, ComesBackAfterTheStreamWasCut) {
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

TEST_F(CameraOverHttpTest, TimesOutWhenNothingComes) {
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
