#include "server/source/virtual_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "server/effects/all_effects.h"
#include "server/source/test_source.h"

namespace touchstone::source {
namespace {

using testing::HasSubstr;

std::shared_ptr<const model::Model> ModelWith(const std::string& effects) {
  auto model =
      model::ParseModel("touchstone: model/1\nname: test\nend_effector: {fingers: 3, spacing_mm: 10}\n" +
                            (effects.empty() ? "" : "effects:\n" + effects),
                        "test", effects::Catalogue());
  EXPECT_TRUE(model.ok()) << model.status();
  return std::make_shared<const model::Model>(*std::move(model));
}

class VirtualSourceTest : public testing::Test {
 protected:
  VirtualSourceTest() : source_(&SmallObjects(), Limits(), ModelWith(""), image::RendererOptions(), &pool_) {}
  static SourceLimits Limits() {
    SourceLimits limits;
    limits.max_touches_per_request = 100;
    return limits;
  }
  static TouchRequest Request(int touches) {
    TouchRequest request;
    request.object = "lat00";
    for (int k = 0; k < touches; ++k) request.touches.push_back(FromAbove(0.0005 * k));
    return request;
  }

  ThreadPool pool_{2};
  VirtualSource source_;
};

TEST_F(VirtualSourceTest, TouchesGiveOneRowEachAndSayWhatSimulatedThem) {
  const auto results = source_.Touch(Request(5), NoObjection);
  ASSERT_TRUE(results.ok()) << results.status();
  EXPECT_EQ(results->fingers, 3);
  EXPECT_EQ(results->size(), 5u);
  EXPECT_EQ(results->travel_m.size(), 15u);
  EXPECT_EQ(results->model->name, "test");
  EXPECT_TRUE(results->journalled.empty());
  for (size_t k = 0; k < 15; ++k)  // without effects: time = travel / speed
    EXPECT_DOUBLE_EQ(results->contact_time_s[k], results->travel_m[k] / touch::kDefaultSpeedMS);
}

TEST_F(VirtualSourceTest, ATouchDependsOnItsIndexAndNotOnItsPlaceInTheRequest) {
  TouchRequest all = Request(6), tail = Request(6);
  all.model = tail.model = ModelWith("  - gaussian_noise: {sigma_us: 5000}\n");
  all.seed = tail.seed = 4;
  tail.touches.erase(tail.touches.begin(), tail.touches.begin() + 2);
  tail.first_index = 2;
  const auto whole = source_.Touch(all, NoObjection), part = source_.Touch(tail, NoObjection);
  ASSERT_TRUE(whole.ok() && part.ok());
  EXPECT_EQ(std::vector<double>(whole->contact_time_s.begin() + 6, whole->contact_time_s.end()),
            part->contact_time_s);
}

TEST_F(VirtualSourceTest, HysteresisSeesTheTouchBefore) {
  TouchRequest request = Request(2);
  request.touches[1] = request.touches[0];
  request.touches[0].target_m.x() = request.touches[1].target_m.x() = 0.01;
  request.model = ModelWith("  - return_hysteresis: {fraction: 0.1}\n");
  const auto results = source_.Touch(request, NoObjection);
  ASSERT_TRUE(results.ok()) << results.status();
  const auto& t = results->contact_time_s;
  const double last_s = std::max({t[0], t[1], t[2]});
  for (int finger = 0; finger < 3; ++finger)
    EXPECT_NEAR(t[3 + finger], t[finger] - 0.1 * (last_s - t[finger]), 1e-12);
}

TEST_F(VirtualSourceTest, AMissingCovariateIsNamedWithItsTouch) {
  TouchRequest request = Request(3);
  request.model = ModelWith(
      "  - formula: {name: warm, adds: time_us, expression: 'k * cov_temperature', parameters: {k: {value: "
      "1, "
      "unit: us, min: -10, max: 10}}}\n");
  for (int k : {0, 2}) request.touches[k].covariates["cov_temperature"] = 20;
  const auto results = source_.Touch(request, NoObjection);
  EXPECT_EQ(results.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(results.status().message()), HasSubstr("touches[1].covariates['cov_temperature']"));
}

TEST_F(VirtualSourceTest, RefusesWhatItsLimitsAndObjectsDoNotAllow) {
  EXPECT_EQ(source_.Touch(Request(101), NoObjection).status().code(), absl::StatusCode::kResourceExhausted);
  TouchRequest unknown = Request(1);
  unknown.object = "lat0";
  const absl::Status status = source_.Touch(unknown, NoObjection).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("did you mean"));
}

TEST_F(VirtualSourceTest, TheGuardsErrorEndsTheWork) {
  const auto stopped = [] { return absl::AbortedError("stopped"); };
  EXPECT_EQ(source_.Touch(Request(1), stopped).status().code(), absl::StatusCode::kAborted);
  CaptureRequest capture;
  capture.object = "lat00";
  capture.cameras.resize(1);
  EXPECT_EQ(source_.Capture(capture, stopped).status().code(), absl::StatusCode::kAborted);
}

TEST_F(VirtualSourceTest, ItsPicturesShowTheModelsEffectsOfPhotographs) {
  CaptureRequest capture;
  capture.object = "lat00";
  capture.image.options.width = capture.image.options.height = 40;
  image::Camera camera;
  camera.eye_m = {0.3, 0, 0.1};
  capture.cameras = {camera, camera};
  const auto pictures = [&](const char* effects) {
    capture.model = effects == nullptr ? nullptr : ModelWith(effects);
    const auto results = source_.Capture(capture, NoObjection);
    EXPECT_TRUE(results.ok()) << results.status();
    return results.ok() ? results->batch.data[0] : std::string();
  };
  const std::string nominal = pictures(nullptr);
  EXPECT_EQ(nominal.substr(0, 1600), nominal.substr(1600));
  const std::string ground = pictures("  - background_level: {grey: 50}\n");
  for (size_t i = 0; i < 3200; ++i)
    if (nominal[i] == 0) {
      EXPECT_EQ(ground[i], 50);
    }
  // Each picture has noise of its own, by seed and number.
  const char* const noisy = "  - background_level: {grey: 50}\n  - image_noise: {sigma_grey: 3}\n";
  const std::string noise = pictures(noisy);
  EXPECT_NE(noise.substr(0, 1600), noise.substr(1600));
  capture.first_index = 1;
  EXPECT_EQ(pictures(noisy).substr(0, 1600), noise.substr(1600));
  capture.seed = 1;
  EXPECT_NE(pictures(noisy).substr(0, 1600), noise.substr(1600));
  capture.image.options.shading_style = image::ShadingStyle::kDarkOnWhite;
  capture.model = ModelWith("  - gamma: {exponent: 0.5}\n");
  EXPECT_THAT(std::string(source_.Capture(capture, NoObjection).status().message()),
              HasSubstr("shading_style"));
}

TEST_F(VirtualSourceTest, ItsTouchesAndTheSamplesOfAListAreTheSame) {
  TouchRequest touches = Request(7);
  touches.seed = 3;
  touches.model = ModelWith("  - tip_radius: {radius_mm: 2}\n  - gaussian_noise: {sigma_us: 2000}\n");
  const auto touched = source_.Touch(touches, NoObjection);
  ASSERT_TRUE(touched.ok()) << touched.status();
  SampleRequest samples;
  samples.objects = {"lat00"};
  samples.specification.plan.kind = touch::Plan::Kind::kList;
  samples.specification.plan.list = touches.touches;
  samples.specification.model = touches.model;
  samples.specification.seed = 3;
  samples.specification.columns = *dataset::ColumnChoice::FromNames({"contact_time"});
  auto stream = source_.Stream(samples);
  ASSERT_TRUE(stream.ok()) << stream.status();
  EXPECT_EQ((*stream)->header().samples, 7u);
  EXPECT_EQ((*stream)->header().fingers, 3);
  const auto batch = (*stream)->Next(NoObjection);
  ASSERT_TRUE(batch.ok() && batch->has_value());
  std::vector<float> times_s(21);
  ASSERT_EQ((*batch)->data[0].size(), sizeof(float) * times_s.size());
  std::memcpy(times_s.data(), (*batch)->data[0].data(), (*batch)->data[0].size());
  for (size_t k = 0; k < times_s.size(); ++k)
    EXPECT_EQ(times_s[k], static_cast<float>(touched->contact_time_s[k]));
  EXPECT_FALSE((*stream)->Next(NoObjection)->has_value());
}

TEST_F(VirtualSourceTest, CapturesAndSamplesAreNormalizedAlike) {
  CaptureRequest capture;
  capture.object = "lat00";
  capture.image.options.width = capture.image.options.height = 64;
  capture.image.renderer_kind = image::RendererKind::kCpu;
  const touch::CommandedTouch touch = FromAbove(0);
  capture.cameras = {image::CameraOfTouch(touch.target_m, touch.approach, touch.lateral, 0.3)};
  const auto plain = source_.Capture(capture, NoObjection);
  ASSERT_TRUE(plain.ok()) << plain.status();
  capture.image.normalize = capture.image.options.mask = true;
  const auto normalized = source_.Capture(capture, NoObjection);
  ASSERT_TRUE(normalized.ok()) << normalized.status();
  const image::Image expected = NormalizedOf(plain->batch.data[0], 64);
  ASSERT_EQ(normalized->columns.size(), 2u);
  EXPECT_EQ(normalized->batch.data[0], BytesOf(expected.pixels));
  EXPECT_EQ(normalized->batch.data[1], BytesOf(expected.mask)) << "the mask that was found";

  SampleRequest samples;
  samples.objects = {"lat00"};
  samples.specification.plan.kind = touch::Plan::Kind::kList;
  samples.specification.plan.list = {touch};
  samples.specification.plan.list[0].standoff_m = 0.3;
  samples.specification.columns = *dataset::ColumnChoice::FromNames({"image"});
  samples.specification.image = capture.image;
  auto stream = source_.Stream(samples);
  ASSERT_TRUE(stream.ok()) << stream.status();
  const auto batch = (*stream)->Next(NoObjection);
  ASSERT_TRUE(batch.ok() && batch->has_value());
  EXPECT_EQ((*batch)->data[0], normalized->batch.data[0]);

  capture.image.options.format = image::PixelFormat::kRgb;
  EXPECT_THAT(std::string(source_.Capture(capture, NoObjection).status().message()), HasSubstr("is grey"));
  capture.image.options.format = image::PixelFormat::kGrey;
  capture.image.options.width = 8;
  EXPECT_THAT(std::string(source_.Capture(capture, NoObjection).status().message()),
              HasSubstr("is too small"));
}

TEST_F(VirtualSourceTest, ExpandsPlansInParts) {
  PlanRequest request;
  request.plan.kind = touch::Plan::Kind::kFaces;
  request.plan.faces.samples_per_face = 2;
  request.plan.faces.rounds = 2;
  request.object = "lat00";
  EXPECT_EQ(source_.ExpandPlan(request, NoObjection)->touches.size(), 24u);
  request.first_index = 20;
  request.count = 10;
  EXPECT_EQ(source_.ExpandPlan(request, NoObjection)->touches.size(), 4u);
  request.first_index = 25;
  EXPECT_EQ(source_.ExpandPlan(request, NoObjection).status().code(), absl::StatusCode::kOutOfRange);
}

}  // namespace
}  // namespace touchstone::source
