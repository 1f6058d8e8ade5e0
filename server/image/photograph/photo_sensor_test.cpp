// What the image sensor makes of light: closed forms, an independent convolution, and the noise's moments.
#include "server/image/photograph/photo_sensor.h"

#include <cmath>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/image/photograph/photo_power.h"
#include "server/image/photograph/photo_test_scene.h"

namespace touchstone::image {
namespace {

class PhotoSensor : public testing::Test {
 protected:
  Photo Nominal() { return MustPhotograph(EffectLines{}, request_); }
  PhotoRequest request_ = RequestOf(MakeSurface("letter", LetterMesh()), CameraAt({0.12, -0.26, 0.09}));
};

TEST_F(PhotoSensor, VignettingFallsWithTheSquareOfTheRadiusFromThePrincipalPoint) {
  const EffectLines ground = {{"background_level", {"grey=100"}}, {"principal_point", {"offset_px=10,-5"}}};
  EffectLines lines = ground;
  lines.push_back({"vignetting", {"strength=0.4"}});
  const Photo plain = MustPhotograph(ground, request_), photo = MustPhotograph(lines, request_);
  for (int i = 0; i < 120 * 90; ++i) {
    const double dx = i % 120 + 0.5 - 70, dy = i / 120 + 0.5 - 40, half_diagonal = 75;
    const double share = 1 - 0.4 * (dx * dx + dy * dy) / (half_diagonal * half_diagonal);
    EXPECT_NEAR(photo.grey[i], plain.grey[i] * share, 1e-3);
  }
}

TEST_F(PhotoSensor, ExposureMultipliesLightAndClipsAtWhite) {
  const EffectLines ground = {{"background_level", {"grey=100"}}, {"ambient_light", {"level=0.4"}}};
  for (const double stops : {-1.5, 1.0, 2.0}) {
    EffectLines lines = ground;
    lines.push_back({"exposure", {absl::StrCat("stops=", stops)}});
    const Photo photo = MustPhotograph(lines, request_);
    int white = 0;
    for (size_t i = 0; i < photo.grey.size(); ++i) {
      const double light = photo.mask[i] != 0 ? photo.light[i] : 100 / 255.0;
      EXPECT_NEAR(photo.grey[i], 255 * std::min(1.0, light * std::pow(2.0, stops)), 1e-3);
      white += photo.grey[i] == 255;
    }
    EXPECT_EQ(white > 1000, stops > 0);
  }
}

TEST_F(PhotoSensor, GammaIsAPowerOfExposedLight) {
  const Photo linear = Nominal();
  for (const double exponent : {0.45, 2.2}) {
    const Photo photo = MustPhotograph({{"gamma", {absl::StrCat("exponent=", exponent)}}}, request_);
    for (size_t i = 0; i < photo.grey.size(); ++i)
      EXPECT_NEAR(photo.grey[i], 255 * std::pow(linear.grey[i] / 255, exponent), 2e-3);
  }
}

TEST_F(PhotoSensor, ResponseIsTheCurveOfSrgb) {
  const Photo linear = Nominal(), photo = MustPhotograph({{"response", {"curve=srgb"}}}, request_);
  for (size_t i = 0; i < photo.grey.size(); ++i) {
    const double light = linear.grey[i] / 255;
    const double recorded = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
    EXPECT_NEAR(photo.grey[i], 255 * recorded, 2e-3);
  }
}

TEST_F(PhotoSensor, BlackLevelIsAddedUpToWhite) {
  const EffectLines bright = {{"exposure", {"stops=2"}}};
  EffectLines lines = bright;
  lines.push_back({"black_level", {"grey=12"}});
  const Photo plain = MustPhotograph(bright, request_), photo = MustPhotograph(lines, request_);
  for (size_t i = 0; i < photo.grey.size(); ++i)
    EXPECT_NEAR(photo.grey[i], std::min(plain.grey[i] + 12.0, 255.0), 1e-3);
}

TEST(PhotoPower, IsThePowerToAMillionth) {
  double worst = 0;
  for (double x = 1e-12; x <= 1.0; x *= 1.0137)
    for (const double exponent : {0.1, 0.45, 1.0, 2.2, 9.0}) {
      const double exact = std::pow(static_cast<double>(static_cast<float>(x)), exponent);
      if (exact > 1e-30)
        worst = std::max(worst,
                         std::abs(PowerOf(static_cast<float>(x), static_cast<float>(exponent)) / exact - 1) /
                             std::max(1.0, std::abs(exponent * std::log(x))));
    }
  EXPECT_LT(worst, 1e-6);
  EXPECT_EQ(PowerOf(0, 0.45f), 0);
  EXPECT_EQ(PowerOf(1, 2.2f), 1);
}

// A picture through a kernel of any shape, its border repeated, in double precision and without tricks.
std::vector<double> Convolve(const std::vector<float>& light, int width, int height,
                             const std::map<std::pair<int, int>, double>& kernel) {
  std::vector<double> result(light.size(), 0.0);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column)
      for (const auto& [place, weight] : kernel)
        result[row * width + column] += weight * light[std::clamp(row + place.second, 0, height - 1) * width +
                                                       std::clamp(column + place.first, 0, width - 1)];
  return result;
}

TEST_F(PhotoSensor, DefocusIsASampledGaussianOfLight) {
  const Photo sharp = Nominal();
  const Photo photo = MustPhotograph({{"defocus_blur", {"sigma_px=1.3"}}}, request_);
  std::map<std::pair<int, int>, double> kernel;
  double sum = 0;
  for (int x = -12; x <= 12; ++x)
    for (int y = -12; y <= 12; ++y) sum += kernel[{x, y}] = std::exp(-(x * x + y * y) / (2 * 1.3 * 1.3));
  for (auto& [place, weight] : kernel) weight /= sum;
  const std::vector<double> expected = Convolve(sharp.grey, 120, 90, kernel);
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(photo.grey[i], expected[i], 2e-3);
}

TEST_F(PhotoSensor, BlurGoesBeforeTheResponse) {
  const Photo blurred = MustPhotograph({{"defocus_blur", {"sigma_px=1.3"}}}, request_);
  const Photo photo = MustPhotograph(
      {{"gamma", {"exponent=0.5"}}, {"exposure", {"stops=1"}}, {"defocus_blur", {"sigma_px=1.3"}}}, request_);
  // In the order of a camera or of the file: the settings are the same.
  for (size_t i = 0; i < photo.grey.size(); ++i)
    EXPECT_NEAR(photo.grey[i], 255 * std::sqrt(std::min(1.0, 2 * blurred.grey[i] / 255.0)), 2e-2);
}

// The mean along the line of bilinear weights, by many small steps.
std::map<std::pair<int, int>, double> LineKernel(double length_px, double angle_rad) {
  std::map<std::pair<int, int>, double> kernel;
  constexpr int kSteps = 200000;
  for (int step = 0; step < kSteps; ++step) {
    const double t = length_px * ((step + 0.5) / kSteps - 0.5);
    const double right = t * std::cos(angle_rad), down = -t * std::sin(angle_rad);
    const int left = static_cast<int>(std::floor(right)), top = static_cast<int>(std::floor(down));
    for (const int dx : {0, 1})
      for (const int dy : {0, 1})
        kernel[{left + dx, top + dy}] +=
            (1 - std::abs(right - left - dx)) * (1 - std::abs(down - top - dy)) / kSteps;
  }
  return kernel;
}

TEST(MotionKernel, IsTheMeanAlongTheLine) {
  for (const double length_px : {0.01, 0.6, 3.0, 7.3}) {
    for (const double angle_deg : {0.0, 30.0, 45.0, 90.0, -20.0, 180.0}) {
      SCOPED_TRACE(absl::StrCat(length_px, " px at ", angle_deg, " deg"));
      std::map<std::pair<int, int>, double> expected = LineKernel(length_px, angle_deg * kRadiansPerDegree);
      double sum = 0;
      for (const MotionTap& tap : MotionKernel(length_px, angle_deg * kRadiansPerDegree)) {
        const auto place = std::pair(tap.right, tap.down);
        EXPECT_NEAR(tap.weight, expected[place], 1e-5) << tap.right << ' ' << tap.down;
        expected.erase(place);
        sum += tap.weight;
      }
      EXPECT_NEAR(sum, 1, 1e-6);
      for (const auto& [place, weight] : expected) EXPECT_LT(weight, 1e-5) << place.first << place.second;
    }
  }
}

TEST(MotionKernel, IsSmoothInLengthAndAngle) {
  // No weight jumps: a thousandth more of either changes every weight by a few thousandths at most.
  const auto weights = [](double length_px, double angle_rad) {
    std::map<std::pair<int, int>, double> result;
    for (const MotionTap& tap : MotionKernel(length_px, angle_rad))
      result[{tap.right, tap.down}] = tap.weight;
    return result;
  };
  for (double length_px = 0; length_px < 5; length_px += 0.0613) {
    auto before = weights(length_px, 0.7), after = weights(length_px + 1e-3, 0.7),
         turned = weights(length_px, 0.701);
    for (auto& [place, weight] : after) EXPECT_NEAR(weight, before[place], 1e-3) << length_px;
    for (auto& [place, weight] : turned) EXPECT_NEAR(weight, before[place], 5e-3) << length_px;
  }
}

TEST_F(PhotoSensor, MotionSmearsUpwardsAt90Degrees) {
  const Photo sharp = Nominal();
  const Photo photo = MustPhotograph({{"motion_blur", {"length_px=4.5", "angle_deg=60"}}}, request_);
  const std::vector<double> expected = Convolve(sharp.grey, 120, 90, LineKernel(4.5, 60 * kRadiansPerDegree));
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(photo.grey[i], expected[i], 5e-3);
}

TEST(PhotoNoise, HasTheVarianceOfReadOutAndPhotons) {
  effects::PhotoSettings settings;
  settings.noise_sigma_grey = 3, settings.noise_gain = 0.2;
  for (const float level : {40.0f, 160.0f}) {
    const std::vector<float> grey(300 * 300, level);
    std::vector<uint8_t> pixels, other;
    DrawPixels(settings, grey, 5, 7, &pixels);
    double sum = 0, squares = 0, neighbours = 0;
    for (size_t i = 0; i < pixels.size(); ++i) {
      const double error = pixels[i] - level;
      sum += error, squares += error * error;
      if (i > 0) neighbours += error * (pixels[i - 1] - level);
    }
    const double variance = 9 + 0.2 * level + 1.0 / 12, count = static_cast<double>(pixels.size());
    // Four standard errors.
    EXPECT_NEAR(sum / count, 0, 4 * std::sqrt(variance / count));
    EXPECT_NEAR(squares / count, variance, 4 * variance * std::sqrt(2 / count));
    EXPECT_NEAR(neighbours / count, 0, 4 * variance / std::sqrt(count));
    // Other seeds and other pictures draw other noise, the same ones the same.
    DrawPixels(settings, grey, 5, 7, &other);
    EXPECT_EQ(other, pixels);
    for (const auto& [seed, index] : {std::pair(6, 7), std::pair(5, 8)}) {
      DrawPixels(settings, grey, seed, index, &other);
      double product = 0;
      for (size_t i = 0; i < pixels.size(); ++i) product += (pixels[i] - level) * (other[i] - level);
      EXPECT_NEAR(product / count, 0, 4 * variance / std::sqrt(count));
    }
  }
}

TEST(PhotoNoise, RoundsToTheNearestLevelAndStaysWithinEightBits) {
  std::vector<uint8_t> pixels;
  DrawPixels(effects::PhotoSettings(), {0.0f, 0.49f, 0.51f, 99.5f, 254.6f, 255.0f}, 1, 1, &pixels);
  EXPECT_THAT(pixels, testing::ElementsAre(0, 0, 1, 100, 255, 255));
  effects::PhotoSettings loud;
  loud.noise_sigma_grey = 100;
  DrawPixels(loud, std::vector<float>(1000, 250.0f), 1, 1, &pixels);
  EXPECT_GT(std::count(pixels.begin(), pixels.end(), 255), 400);
}

}  // namespace
}  // namespace touchstone::image
