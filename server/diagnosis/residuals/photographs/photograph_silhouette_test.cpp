#include "server/diagnosis/residuals/photographs/photograph_silhouette.h"

#include <gtest/gtest.h>

#include <cmath>

namespace touchstone::diagnosis::residuals {
namespace {

constexpr int kSide = 60;

// A bright square of 20 pixels a side on a background.
std::vector<float> Square(int left, int top, float object, float background) {
  std::vector<float> grey(kSide * kSide, background);
  for (int y = top; y < top + 20; ++y)
    for (int x = left; x < left + 20; ++x) grey[y * kSide + x] = object;
  return grey;
}
std::vector<uint8_t> MaskOf(int left, int top) {
  const std::vector<float> square = Square(left, top, 255, 0);
  return {square.begin(), square.end()};
}

TEST(PhotographSilhouette, DistancesAreThoseOfBruteForce) {
  std::vector<char> set(kSide * kSide, 0);
  for (const int at : {5, 777, 1234, 3599}) set[at] = 1;
  const std::vector<float> distances = SquaredDistances(set, kSide, kSide);
  for (int at = 0; at < kSide * kSide; ++at) {
    float nearest = 1e9f;
    for (const int to : {5, 777, 1234, 3599}) {
      const int dx = at % kSide - to % kSide, dy = at / kSide - to / kSide;
      nearest = std::min(nearest, static_cast<float>(dx * dx + dy * dy));
    }
    ASSERT_EQ(distances[at], nearest) << at;
  }
}

TEST(PhotographSilhouette, AShiftedSquareOverlapsAsItShould) {
  const Silhouette same =
      CompareSilhouettes(Square(20, 20, 120, 0), Square(20, 20, 120, 0), MaskOf(20, 20), kSide, kSide);
  EXPECT_EQ(same.iou, 1);
  EXPECT_EQ(same.contour_distance_px, 0);
  const Silhouette apart =
      CompareSilhouettes(Square(24, 20, 120, 0), Square(20, 20, 120, 0), MaskOf(20, 20), kSide, kSide);
  EXPECT_DOUBLE_EQ(apart.iou, 16.0 / 24.0);
  EXPECT_GT(apart.contour_distance_px, 1);
  EXPECT_LE(apart.contour_distance_px, 4);
}

TEST(PhotographSilhouette, AnObjectAsBrightAsItsBackgroundTellsNothing) {
  const Silhouette hidden =
      CompareSilhouettes(Square(20, 20, 80, 80), Square(20, 20, 80, 0), MaskOf(20, 20), kSide, kSide);
  EXPECT_TRUE(std::isnan(hidden.iou));
  // A dark object on a bright ground is seen as well as the other way round.
  const Silhouette dark =
      CompareSilhouettes(Square(20, 20, 20, 80), Square(20, 20, 20, 0), MaskOf(20, 20), kSide, kSide);
  EXPECT_EQ(dark.iou, 1);
}

TEST(PhotographSilhouette, DirtIsNoObject) {
  std::vector<float> measured = Square(20, 20, 120, 0);
  measured[3 * kSide + 3] = 200;
  EXPECT_EQ(CompareSilhouettes(measured, Square(20, 20, 120, 0), MaskOf(20, 20), kSide, kSide).iou, 1);
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
