#include "server/source/physical_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "server/session/journal/command_bytes.h"
#include "server/source/test_source.h"

namespace touchstone::source {
namespace {

using testing::HasSubstr;

// Journals nothing, and misses with a finger as often as it is told.
class FakeDevice final : public RigDevice {
 public:
  absl::StatusOr<session::JournalTouch> Touch(const TouchCommand& command,
                                              const MotionGuard& guard) override {
    if (const absl::Status status = guard(); !status.ok()) return status;
    commands.push_back(command);
    session::JournalTouch touch;
    touch.id = command.id;
    touch.object = command.object;
    touch.command = command.bytes;
    touch.stage = session::TouchStage::kDone;
    for (int finger = 0; finger < 3; ++finger) touch.result.fingers.push_back({1.0 + 0.1 * finger, {}, 0});
    if (misses > 0) {
      --misses;
      touch.result.fingers[2].contact_time_s = NAN;
    }
    return touch;
  }
  absl::StatusOr<std::optional<session::JournalSeries>> Series(const std::string&,
                                                               const std::string& id) const override {
    return session::JournalSeries{"a test", "states of " + id};
  }
  absl::StatusOr<source::Photograph> Photograph(const ViewCommand& command, const MotionGuard&) override {
    views.push_back(command);
    source::Photograph photograph;
    photograph.frame.width = photograph.frame.height = 2;
    photograph.frame.rgb.assign(12, 7);
    photograph.object_from_camera = command.object_from_camera * Eigen::Translation3d(0.0001, 0, 0);
    photograph.unix_s = 1e9;
    photograph.deviation_m = 0.0001;
    return photograph;
  }
  bool has_camera() const override { return camera; }
  image::Intrinsics IntrinsicsOf(const image::Frame& frame) const override {
    return image::PinholeIntrinsics(frame.width, frame.height, 0.8);
  }
  int fingers() const override { return 3; }
  double spacing_m() const override { return 0.03; }
  bool moves() const override { return true; }
  SourceStatus Status() const override { return {}; }
  SourceState State() const override { return SourceState::kIdle; }

  std::vector<TouchCommand> commands;
  std::vector<ViewCommand> views;
  int misses = 0;
  bool camera = true;
};

class PhysicalSourceTest : public testing::Test {
 protected:
  PhysicalSourceTest() {
    auto device = std::make_unique<FakeDevice>();
    device_ = device.get();
    const Rectifier grey_picture = [this](const image::Frame&, const image::Intrinsics&, int width,
                                          int height, double, bool) {
      return picture_.empty() ? std::vector<uint8_t>(static_cast<size_t>(width) * height, 9) : picture_;
    };
    source_ =
        std::make_unique<PhysicalSource>(&SmallObjects(), SourceLimits(), std::move(device), grey_picture);
  }

  static SampleRequest Faces(const std::vector<std::string>& columns) {
    SampleRequest request;
    request.objects = {"lat00", "lat10"};
    request.specification.plan.kind = touch::Plan::Kind::kFaces;
    request.specification.plan.faces.samples_per_face = 1;
    request.specification.plan.faces.rounds = 2;
    request.specification.columns = *dataset::ColumnChoice::FromNames(columns);
    request.key = "0123456789abcdef";
    return request;
  }

  FakeDevice* device_;
  std::unique_ptr<PhysicalSource> source_;
  std::vector<uint8_t> picture_;  // that the camera sees; empty: nothing but grey
};

TEST_F(PhysicalSourceTest, RepeatsOfATouchAreNumbered) {
  TouchRequest request;
  request.object = "lat00";
  request.touches = {FromAbove(0), FromAbove(0.01), FromAbove(0)};
  request.touches[2].session_time_s = 5;  // when it is made does not make it another touch
  request.ids = {"a", "b", "c"};
  const auto results = source_->Touch(request, NoObjection);
  ASSERT_TRUE(results.ok()) << results.status();
  EXPECT_EQ(results->session, "default");
  EXPECT_EQ(results->size(), 3u);
  ASSERT_EQ(device_->commands.size(), 3u);
  EXPECT_EQ(device_->commands[0].bytes, device_->commands[2].bytes);
  EXPECT_EQ(device_->commands[0].repeat, 0u);
  EXPECT_EQ(device_->commands[1].repeat, 0u);
  EXPECT_EQ(device_->commands[2].repeat, 1u);
  EXPECT_EQ(results->journalled[1].id, "b");
}

TEST_F(PhysicalSourceTest, ASampleIsDrawnAgainUntilEveryFingerHits) {
  device_->misses = 2;
  auto stream = source_->Stream(Faces({"index", "object", "descriptor", "contact"}));
  ASSERT_TRUE(stream.ok()) << stream.status();
  EXPECT_EQ((*stream)->header().samples, 24u);
  EXPECT_EQ((*stream)->header().model, nullptr);
  const auto batch = (*stream)->Next(NoObjection);
  ASSERT_TRUE(batch.ok() && batch->has_value()) << batch.status();
  EXPECT_EQ((*batch)->rows, 1u);  // unless told otherwise, touch by touch
  ASSERT_EQ(device_->commands.size(), 3u);
  // The first three draws would miss by the mesh: the arm does not try them.
  EXPECT_EQ(device_->commands[0].id, "dataset-0123456789abcdef-0-3");
  EXPECT_EQ(device_->commands[2].id, "dataset-0123456789abcdef-0-5");
  float descriptor_s[3];
  std::memcpy(descriptor_s, (*batch)->data[2].data(), sizeof descriptor_s);
  EXPECT_FLOAT_EQ(descriptor_s[0], 0);
  EXPECT_FLOAT_EQ(descriptor_s[2], 0.2F);
  float contact_m[9];
  std::memcpy(contact_m, (*batch)->data[3].data(), sizeof contact_m);
  for (const float value : contact_m) EXPECT_TRUE(std::isnan(value));  // not measured
}

TEST_F(PhysicalSourceTest, AListsTouchStandsWithItsMiss) {
  SampleRequest request = Faces({"contact_time"});
  request.specification.plan.kind = touch::Plan::Kind::kList;
  request.specification.plan.list = {FromAbove()};
  device_->misses = 1;
  const auto batch = (*source_->Stream(request))->Next(NoObjection);
  ASSERT_TRUE(batch.ok() && batch->has_value());
  float times_s[3];
  std::memcpy(times_s, (*batch)->data[0].data(), sizeof times_s);
  EXPECT_FLOAT_EQ(times_s[1], 1.1F);
  EXPECT_TRUE(std::isnan(times_s[2]));
  EXPECT_EQ(device_->commands.size(), 1u);
}

TEST_F(PhysicalSourceTest, GivesUpAfterMaxDraws) {
  SampleRequest request = Faces({});
  request.specification.max_draws = 6;  // three of which the mesh rules out
  device_->misses = 100;
  const absl::Status status = (*source_->Stream(request))->Next(NoObjection).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), HasSubstr("sample 0: no touch of 6 draws"));
  EXPECT_EQ(device_->commands.size(), 3u);
}

TEST_F(PhysicalSourceTest, RefusesWhatARigCannotGive) {
  SampleRequest sphere = Faces({});
  sphere.specification.plan.kind = touch::Plan::Kind::kSphere;
  sphere.specification.samples = 3;
  EXPECT_THAT(std::string(source_->Stream(sphere).status().message()), HasSubstr("plan.sphere"));
  CaptureRequest depth;
  depth.object = "lat00";
  depth.cameras.resize(1);
  depth.cameras[0].eye_m = {0.3, 0, 0};
  depth.image.options.depth = true;
  EXPECT_THAT(std::string(source_->Capture(depth, NoObjection).status().message()), HasSubstr("image.depth"));
  EXPECT_TRUE(device_->views.empty());  // nothing moved for it
  device_->camera = false;
  EXPECT_THAT(std::string(source_->Stream(Faces({"image"})).status().message()), HasSubstr("no camera"));
}

TEST_F(PhysicalSourceTest, PhotographsEverySampleFromItsTouch) {
  SampleRequest request = Faces({"image"});
  request.specification.image.options.width = 4;
  request.specification.image.options.height = 3;
  const auto batch = (*source_->Stream(request))->Next(NoObjection);
  ASSERT_TRUE(batch.ok() && batch->has_value()) << batch.status();
  EXPECT_EQ((*batch)->data[0], std::string(12, 9));
  ASSERT_EQ(device_->views.size(), 1u);
  const touch::CommandedTouch& touch = device_->commands[0].touch;
  EXPECT_LT((device_->views[0].object_from_camera.translation() -
             (touch.target_m - touch.approach * touch.standoff_m))
                .norm(),
            1e-12);
}

TEST_F(PhysicalSourceTest, CapturesAndSamplesAreNormalizedAsThoseOfAVirtualSourceAre) {
  constexpr int kSide = 64;
  for (int k = 0; k < kSide * kSide; ++k) {  // a bright ball on a ground that is lit from the left
    const int x = k % kSide - kSide / 2, y = k / kSide - kSide / 2;
    picture_.push_back(static_cast<uint8_t>(x * x + y * y < 200 ? 180 + y : 60 - x / 4));
  }
  CaptureRequest capture;
  capture.object = "lat00";
  capture.image.options.width = capture.image.options.height = kSide;
  capture.cameras.resize(1);
  capture.cameras[0].eye_m = {0.3, 0, 0};
  const auto plain = source_->Capture(capture, NoObjection);
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_EQ(plain->batch.data[0], BytesOf(picture_));
  capture.image.normalize = capture.image.options.mask = true;
  const auto normalized = source_->Capture(capture, NoObjection);
  ASSERT_TRUE(normalized.ok()) << normalized.status();
  const image::Image expected = NormalizedOf(plain->batch.data[0], kSide);
  ASSERT_EQ(normalized->columns.size(), 2u);
  EXPECT_EQ(normalized->batch.data[0], BytesOf(expected.pixels));
  EXPECT_EQ(normalized->batch.data[1], BytesOf(expected.mask));

  SampleRequest samples = Faces({"image"});
  samples.specification.image = capture.image;
  const auto batch = (*source_->Stream(samples))->Next(NoObjection);
  ASSERT_TRUE(batch.ok() && batch->has_value()) << batch.status();
  EXPECT_EQ((*batch)->data[0], BytesOf(expected.pixels));
}

}  // namespace
}  // namespace touchstone::source
