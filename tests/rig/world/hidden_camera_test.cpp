#include "tests/rig/world/hidden_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "server/geometry/shapes/supershape.h"
#include "server/image/renderers/renderer.h"
#include "tests/rig/world/camera_light.h"

namespace touchstone::rig {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 80, kHeight = 60;
constexpr double kFovRad = 0.7853981633974483;
const double kFocal = 0.5 * kHeight / std::tan(0.5 * kFovRad);

HiddenCamera Hidden(const std::vector<std::string>& assignments) {
  HiddenCamera camera;
  for (const std::string& each : assignments) EXPECT_TRUE(HideInCamera(each, &camera)) << each;
  return camera;
}

// The ideal slope along an axis (0: right, 1: down) of the ray that each pixel shows.
std::vector<double> SlopesSeen(const HiddenCamera& hidden, int axis) {
  return ThroughLens(hidden, kWidth, kHeight, kFovRad,
                     [axis](const std::vector<Eigen::Vector2d>& rays) {
                       std::vector<double> slopes;
                       for (const Eigen::Vector2d& ray : rays) slopes.push_back(ray[axis]);
                       return slopes;
                     })
      .level;
}

TEST(HiddenCamera, ShowsEveryRayWhereOpenCvsModelPutsIt) {
  const HiddenCamera hidden = Hidden({"radial_distortion.k1=-0.3", "radial_distortion.k2=0.1",
                                      "principal_point.offset_px=2,-3", "focal_error.relative=0.05"});
  const std::vector<double> slope_x = SlopesSeen(hidden, 0), slope_y = SlopesSeen(hidden, 1);
  for (int y = 0; y < kHeight; y += 7)
    for (int x = 0; x < kWidth; x += 7) {
      const size_t at = static_cast<size_t>(y) * kWidth + x;
      const double r2 = slope_x[at] * slope_x[at] + slope_y[at] * slope_y[at];
      const double stretched = (1 - 0.3 * r2 + 0.1 * r2 * r2) * kFocal * 1.05;
      EXPECT_NEAR(0.5 * kWidth + 2 + stretched * slope_x[at], x + 0.5, 1e-9) << x << " " << y;
      EXPECT_NEAR(0.5 * kHeight - 3 + stretched * slope_y[at], y + 0.5, 1e-9) << x << " " << y;
    }
}

TEST(HiddenCamera, AnIdealLensIsThePinhole) {
  const std::vector<double> slopes = SlopesSeen(HiddenCamera(), 0);
  EXPECT_DOUBLE_EQ(slopes[0], (0.5 - 0.5 * kWidth) / kFocal);
}

TEST(HiddenCamera, DevelopsEvenLightByItsDefinitions) {
  const auto developed = [](const std::vector<std::string>& hidden, double level) {
    Light light{kWidth, kHeight, std::vector<double>(kWidth * kHeight, level)};
    Develop(Hidden(hidden), &light);
    return light.level;
  };
  EXPECT_DOUBLE_EQ(developed({"exposure.stops=-1"}, 0.5)[7], 0.25);
  EXPECT_DOUBLE_EQ(developed({"exposure.stops=1"}, 0.75)[7], 1);  // clipped at white
  EXPECT_DOUBLE_EQ(developed({"gamma.exponent=2"}, 0.5)[7], 0.25);
  EXPECT_DOUBLE_EQ(developed({"exposure.stops=1", "gamma.exponent=0.5"}, 0.125)[7], 0.5);  // in this order
  const std::vector<double> vignetted = developed({"vignetting.strength=0.4"}, 0.5);
  EXPECT_DOUBLE_EQ(vignetted[0], 0.5 * (1 - 0.4 * (39.5 * 39.5 + 29.5 * 29.5) / (40 * 40 + 30 * 30)));
  EXPECT_GT(vignetted[30 * kWidth + 40], 0.4999);
}

TEST(HiddenCamera, DefocusTurnsAnEdgeIntoTheErrorFunction) {
  Light light{kWidth, kHeight, {}};
  for (int k = 0; k < kWidth * kHeight; ++k) light.level.push_back(k % kWidth < kWidth / 2 ? 0 : 1);
  Develop(Hidden({"defocus_blur.sigma_px=2"}), &light);
  for (int x = 20; x < 60; ++x)
    EXPECT_NEAR(light.level[30 * kWidth + x], 0.5 * (1 + std::erf((x + 0.5 - 40) / (2 * std::sqrt(2)))),
                0.003)
        << x;
}

TEST(HiddenCamera, NoiseHasTheVarianceOfItsDefinition) {
  const Light light{400, 400, std::vector<double>(400 * 400, 100 / 255.0)};
  std::mt19937_64 random(5);
  const std::vector<uint8_t> pixels =
      Record(Hidden({"image_noise.sigma_grey=3", "image_noise.gain=0.16"}), light, &random);
  double sum = 0, squares = 0;
  for (const uint8_t level : pixels) sum += level, squares += level * level;
  const double mean = sum / pixels.size(), variance = squares / pixels.size() - mean * mean;
  EXPECT_NEAR(mean, 100, 0.06);
  EXPECT_NEAR(variance, 9 + 16 + 1.0 / 12, 0.4);
}

TEST(HiddenCamera, SitsAsideInItsOwnFrame) {
  Eigen::Affine3d nominal = Eigen::Affine3d::Identity();
  nominal.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix();
  nominal.translation() = Eigen::Vector3d(0, 0, 0.4);
  const Eigen::Affine3d real = RealPose(
      Hidden({"camera_translation.offset_mm=1,2,3", "camera_rotation.rotation_deg=0,0,90"}), nominal);
  EXPECT_TRUE(real.translation().isApprox(Eigen::Vector3d(0.001, -0.002, 0.397)));
  // Right-handed about the view: what was down is right now.
  EXPECT_TRUE(real.linear().col(0).isApprox(nominal.linear().col(1)));
  EXPECT_TRUE(real.linear().col(2).isApprox(nominal.linear().col(2)));
}

// Two programs, written apart from the same words.
TEST(CameraLight, OfAPinholeIsTheRenderersPicture) {
  const std::shared_ptr<const geometry::Surface> surface =
      geometry::Surface::Create("lat20",
                                geometry::MakeSupershape(*geometry::NamedSupershape("lat20"), 2000).value())
          .value();
  Eigen::Affine3d pose = Eigen::Affine3d::Identity();
  pose.linear() = (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()) *
                   Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix());
  pose.translation() = -0.3 * pose.linear().col(2);
  const CameraLight light(surface);
  const Light seen = ThroughLens(HiddenCamera(), kWidth, kHeight, kFovRad,
                                 [&](const auto& rays) { return light.Along(rays, pose, pose, 0); });
  image::Camera camera;
  camera.eye_m = pose.translation(), camera.at_m = Eigen::Vector3d::Zero();
  camera.up = -pose.linear().col(1);
  image::ImageOptions options;
  options.width = kWidth, options.height = kHeight;
  const auto rendered = (*image::CreateCpuRenderer())->Render(surface, camera, options);
  ASSERT_TRUE(rendered.ok()) << rendered.status();
  int apart = 0, lit = 0;
  for (int k = 0; k < kWidth * kHeight; ++k) {
    apart += std::abs(255 * seen.level[k] - rendered->pixels[k]) > 1;
    lit += seen.level[k] > 0;
  }
  EXPECT_LE(apart, 2) << "on edges alone rounding may decide";
  EXPECT_GT(lit, 500);
}

TEST(HiddenCamera, WhatIsWrongIsNamed) {
  const auto error = [](const std::string& assignment) -> std::string {
    HiddenCamera camera;
    try {
      return HideInCamera(assignment, &camera) ? "hidden" : "not of a camera";
    } catch (const std::invalid_argument& wrong) {
      return wrong.what();
    }
  };
  EXPECT_EQ(error("tip_radius.radius_mm=2"), "not of a camera");
  EXPECT_THAT(error("exposure.stop=1"), HasSubstr("of exposure there are exposure.stops"));
  EXPECT_THAT(error("exposure.stops"), HasSubstr("must look like"));
  EXPECT_THAT(error("exposure.stops=nan"), HasSubstr("'nan' is no number from"));
  EXPECT_THAT(error("exposure.stops=9"), HasSubstr("'9' is no number from"));
  EXPECT_THAT(error("camera_rotation.rotation_deg=1,2"), HasSubstr("2 numbers, must be 3"));
}

}  // namespace
}  // namespace touchstone::rig
