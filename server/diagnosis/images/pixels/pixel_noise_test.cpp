#include "server/diagnosis/images/pixels/pixel_noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::images {
namespace {

TEST(PixelNoise, RecordsWhatRoundedAndClippedDrawsDoOnAverage) {
  PixelNoise noise;
  noise.sigma_grey = std::sqrt(9 + 1.0 / 12);  // rounding included
  const RecordTable table(noise);
  for (const double grey : {0.0, 2.0, 6.0, 120.0, 254.0}) {
    RandomStream random(3, RandomDomain::kTest);
    constexpr int kDraws = 1000000;
    double sum = 0, squares = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double drawn = std::min(std::max(std::round(grey + 3 * random.Normal()), 0.0), 255.0);
      sum += drawn, squares += drawn * drawn;
    }
    const double mean = sum / kDraws, variance = squares / kDraws - mean * mean;
    // Of millions of pixels, a sixtieth of a grey level at black was taken for light of the ground.
    EXPECT_NEAR(table.Mean(static_cast<float>(grey)), mean, 0.01) << grey;
    EXPECT_NEAR(table.Variance(mean), variance, 0.15) << grey;
  }
}

TEST(PixelNoise, RecordsAPictureAsItsPixels) {
  PixelNoise noise;
  noise.sigma_grey = 2, noise.gain = 0.02;
  const RecordTable table(noise);
  std::vector<float> picture;
  for (int i = 0; i < 1003; ++i)
    picture.push_back(-3 + 0.26f * static_cast<float>(i));  // beyond black and white
  std::vector<float> means = picture;
  table.ToMeans(&means);
  for (size_t i = 0; i < picture.size(); ++i) EXPECT_EQ(means[i], table.Mean(picture[i])) << picture[i];
}

TEST(PixelNoise, IsFoundInPicturesOfSmoothShades) {
  constexpr int kSide = 300;
  RandomStream random(4, RandomDomain::kTest);
  std::vector<float> image(kSide * kSide);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const double grey = 30 + 0.6 * x, sigma = std::sqrt(4 + 0.05 * grey);
      image[static_cast<size_t>(y) * kSide + x] =
          static_cast<float>(std::lround(grey + sigma * random.Normal()));
    }
  NoiseGatherer gathered;
  gathered.Add(image, image, kSide, kSide, 1);
  const PixelNoise found = gathered.Estimate();
  EXPECT_NEAR(found.gain, 0.05, 5 * found.gain_error);
  EXPECT_NEAR(found.Variance(120), 4 + 1.0 / 12 + 0.05 * 120, 0.3);
}

// Repeats of a picture whose light grows beyond white, as overexposed ones have it; a third of it lies at black.
TEST(PixelNoise, IsFoundWherePixelsAreNotClipped) {
  constexpr int kSide = 300;
  for (const double step : {1.0, 2.0, 4.0}) {
    RandomStream random(6, RandomDomain::kTest);
    std::vector<float> image(kSide * kSide), difference(kSide * kSide);
    for (int i = 0; i < kSide * kSide; ++i) {
      const double grey = std::min(std::max(step * (i % kSide - 100), 0.0), 255.0);
      const auto taken = [&] {
        return static_cast<float>(std::min(std::max(std::lround(grey + 2 * random.Normal()), 0L), 255L));
      };
      image[i] = taken();
      difference[i] = image[i] - taken();
    }
    NoiseGatherer gathered;
    gathered.Add(difference, image, kSide, kSide, 0.5);
    const PixelNoise found = gathered.Estimate();
    EXPECT_NEAR(found.sigma_grey, std::sqrt(4 + 1.0 / 12), 4 * found.sigma_error) << step;
    EXPECT_NEAR(found.gain, 0, 4 * found.gain_error) << step;
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::images
