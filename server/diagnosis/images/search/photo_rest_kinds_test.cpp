#include "server/diagnosis/images/rows/photo_rest_kinds.h"

#include <gtest/gtest.h>

#include "server/diagnosis/images/photo_test_set.h"
#include "server/diagnosis/images/rows/stuck_pixels.h"
#include "server/diagnosis/images/search/photo_quality.h"

namespace touchstone::diagnosis::images {
namespace {

// What the given model leaves of pictures that something is done to.
std::vector<KindOfRest> KindsUnder(decltype(HiddenCamera::unlisted) unlisted) {
  HiddenCamera rig;
  rig.unlisted = std::move(unlisted);
  const DiagnosisInput input = MakePhotoInput(rig);
  const absl::StatusOr<Photographs> photographs = MakePhotographs(input, nullptr);
  EXPECT_TRUE(photographs.ok()) << photographs.status();
  const absl::StatusOr<std::vector<image::Photo>> expected =
      ExpectPhotographs(*photographs, *input.model, true, nullptr);
  EXPECT_TRUE(expected.ok()) << expected.status();
  return KindsOfRest(*photographs, *expected, nullptr);
}

TEST(RestKinds, NoneIsNamedOfNoise) {
  EXPECT_TRUE(KindsUnder(nullptr).empty());
}

TEST(RestKinds, FlickerIsTheLightOfEachPicture) {
  const auto kinds = KindsUnder([](int photograph, int, int, const image::Photo& photo, size_t pixel) {
    RandomStream random(5, RandomDomain::kTest, photograph);
    return 0.1 * random.Normal() * photo.grey[pixel];
  });
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds[0].kind, RestKind::kLightOfPicture);
  EXPECT_GT(kinds[0].share, 0.8);
  EXPECT_EQ(kinds[0].words.find("paint"), std::string::npos);
}

TEST(RestKinds, RowsThatAreReadLaterLieElsewhere) {
  const auto kinds = KindsUnder([](int photograph, int column, int row, const image::Photo& photo,
                                   size_t pixel) {
    const double moved_px = (photograph % 2 == 0 ? 4.0 : -4.0) * (row + 0.5) / photo.height;
    const int from = std::min(std::max(static_cast<int>(std::lround(column - moved_px)), 0), photo.width - 1);
    return static_cast<double>(photo.grey[static_cast<size_t>(row) * photo.width + from]) - photo.grey[pixel];
  });
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds[0].kind, RestKind::kPlaceOfPicture);
  EXPECT_NE(kinds[0].cause.find("rolling shutter"), std::string::npos) << kinds[0].cause;
}

TEST(RestKinds, ACauseIsNamedOnlyOfWhatTakesHalf) {
  const KindOfRest most = {RestKind::kLightOfPicture, 0.6, "It flickers.", "The lamp does."};
  EXPECT_EQ(InWords(most), "It flickers. The lamp does.");
  const KindOfRest little = {RestKind::kLightOfPicture, 0.4, "It flickers.", "The lamp does."};
  EXPECT_EQ(InWords(little), "It flickers.");
}

// Pictures of one object, turned by 0.8 degrees: not by a shutter.
TEST(RestKinds, WhatOneObjectHasIsNamedWhereNothingElseTakesMostOfIt) {
  const auto kinds =
      KindsUnder([](int photograph, int column, int row, const image::Photo& photo, size_t pixel) {
        if (photograph < 16) return 0.0;
        const double x = column - 79.5, y = row - 79.5, angle = 0.8 * M_PI / 180;
        const double from_x = 79.5 + x - angle * y, from_y = 79.5 + y + angle * x;
        const int left = std::clamp(static_cast<int>(from_x), 0, photo.width - 2);
        const int top = std::clamp(static_cast<int>(from_y), 0, photo.height - 2);
        const double u = from_x - left, v = from_y - top;
        const auto grey = [&](int i, int j) -> double {
          return photo.grey[static_cast<size_t>(j) * photo.width + i];
        };
        return (1 - v) * ((1 - u) * grey(left, top) + u * grey(left + 1, top)) +
               v * ((1 - u) * grey(left, top + 1) + u * grey(left + 1, top + 1)) - photo.grey[pixel];
      });
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds[0].kind, RestKind::kOneObject);
  EXPECT_NE(kinds[0].words.find("the pictures of lat20 (8 of 24)"), std::string::npos) << kinds[0].words;
}

TEST(RestKinds, PixelsThatShowTheSameAlwaysAreCountedAndPlaced) {
  const auto is_hot = [](int column, int row) { return column % 37 == 11 && row % 29 == 7; };
  const auto kinds = KindsUnder([&](int, int column, int row, const image::Photo& photo, size_t pixel) {
    return is_hot(column, row) ? 255.0 - photo.grey[pixel] : 0.0;
  });
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds[0].kind, RestKind::kStuckPixels);
  EXPECT_GT(kinds[0].share, 0.9);
  EXPECT_NE(kinds[0].words.find("30 pixels show"), std::string::npos) << kinds[0].words;
  EXPECT_NE(kinds[0].words.find("column 11 row 7, column 48 row 7"), std::string::npos) << kinds[0].words;
}

TEST(RestKinds, DirtLiesInThePictureAndPaintOnTheObjects) {
  auto kinds = KindsUnder([](int, int column, int row, const image::Photo& photo, size_t pixel) {
    const double x = column - 100.0, y = row - 70.0;
    return x * x + y * y < 20 * 20 ? -0.3 * photo.grey[pixel] : 0.0;
  });
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds[0].kind, RestKind::kInPicture);
  kinds = KindsUnder([](int, int, int, const image::Photo& photo, size_t pixel) {
    if (!photo.mask[pixel]) return 0.0;
    const Eigen::Vector3f& p = photo.point_m[pixel];
    return 0.06 * photo.grey[pixel] *
           (std::sin(130 * p.x() + 1) + std::sin(110 * p.y()) + std::sin(150 * p.z()));
  });
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds[0].kind, RestKind::kOnObjects);
  EXPECT_NE(kinds[0].cause.find("paint"), std::string::npos);
}

TEST(RestKinds, AFewPicturesAreNamed) {
  const auto kinds = KindsUnder([](int photograph, int column, int row, const image::Photo&, size_t) {
    return photograph == 7 && column > 100 && row > 100 ? 90.0 : 0.0;
  });
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds[0].kind, RestKind::kFewPictures);
  EXPECT_NE(kinds[0].words.find("image 7 of"), std::string::npos) << kinds[0].words;
}

}  // namespace
}  // namespace touchstone::diagnosis::images
