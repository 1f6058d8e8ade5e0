#include "server/diagnosis/images/rows/photo_rest_kinds.h"

#include <gtest/gtest.h>

#include "server/diagnosis/images/photo_test_set.h"
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
  EXPECT_NE(kinds[0].words.find("rolling shutter"), std::string::npos) << kinds[0].words;
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
  EXPECT_NE(kinds[0].words.find("paint"), std::string::npos);
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
