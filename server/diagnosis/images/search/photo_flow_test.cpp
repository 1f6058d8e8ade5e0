#include "server/diagnosis/images/rows/photo_flow.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "server/diagnosis/images/photo_test_set.h"
#include "server/diagnosis/images/photographs.h"
#include "server/diagnosis/images/search/photo_quality.h"

namespace touchstone::diagnosis::images {
namespace {

HiddenCamera SmallCamera() {
  HiddenCamera rig;
  rig.objects = {"lat10"};
  rig.photographs = 4;
  rig.side_px = 96;
  return rig;
}

image::PhotoSimulator SimulatorOf(const NamedValues& effects) {
  return image::PhotoSimulator(
      std::make_shared<const model::Model>(WithPhotoEffects(model::NominalModel(), effects)));
}

image::Photo PhotoWithDetails(const image::PhotoSimulator& simulator, const image::PhotoRequest& request) {
  image::PhotoOutputs outputs;
  outputs.details = true;
  const absl::StatusOr<image::Photo> photo = simulator.Run(request, outputs, nullptr);
  EXPECT_TRUE(photo.ok()) << photo.status();
  return *photo;
}

TEST(PhotoFlow, PointsThatPixelsSeeAreProjectedToTheirCentres) {
  const absl::StatusOr<Photographs> photographs = MakePhotographs(MakePhotoInput(SmallCamera()), nullptr);
  ASSERT_TRUE(photographs.ok()) << photographs.status();
  for (const NamedValues& effects :
       {NamedValues{}, NamedValues{{"radial_distortion", {"k1=-0.2", "k2=0.05"}}},
        NamedValues{{"camera_rotation", {"rotation_deg=0.5,-0.3,1"}}, {"focal_error", {"relative=0.02"}}},
        NamedValues{{"object_pose", {"translation_mm=1,-2,0.5", "rotation_deg=1,0,-2"}},
                    {"object_scale", {"relative=0.03"}}}}) {
    const image::PhotoSimulator simulator = SimulatorOf(effects);
    const image::Photo photo = PhotoWithDetails(simulator, photographs->requests[0]);
    const std::vector<Eigen::Vector2d> pixels = simulator.Project(photographs->requests[0], photo.point_m);
    int seen = 0;
    double farthest = 0;
    for (size_t at = 0; at < pixels.size(); ++at) {
      if (photo.mask[at] == 0) continue;
      ++seen;
      const Eigen::Vector2d centre(static_cast<int>(at) % photo.width + 0.5,
                                   static_cast<int>(at) / photo.width + 0.5);
      farthest = std::max(farthest, (pixels[at] - centre).norm());
    }
    EXPECT_GT(seen, 500);
    EXPECT_LT(farthest, 2e-3);
  }
}

TEST(PhotoFlow, CarriesAsMuchLightAsAShiftByAPixel) {
  const absl::StatusOr<Photographs> photographs = MakePhotographs(MakePhotoInput(SmallCamera()), nullptr);
  ASSERT_TRUE(photographs.ok()) << photographs.status();
  const image::PhotoSimulator here = SimulatorOf({});
  const image::PhotoSimulator right = SimulatorOf({{"principal_point", {"offset_px=1,0"}}});
  const image::Photo photo = PhotoWithDetails(here, photographs->requests[1]),
                     there = PhotoWithDetails(right, photographs->requests[1]);
  const std::vector<float> everywhere(photo.grey.size(), 1.0f);
  const PictureFlow flow = FlowOfPicture(photographs->requests[1], photo, everywhere, here, right);
  EXPECT_NEAR(flow.farthest_px, 1, 1e-4);
  const std::vector<float> carried = CarriedBy(flow, photo, photo.grey);
  double by_flow = 0, by_simulation = 0;
  for (size_t at = 0; at < carried.size(); ++at) {
    const double column = static_cast<double>(at % photo.width);
    by_flow += column * carried[at];
    by_simulation += column * (there.grey[at] - photo.grey[at]);
  }
  // Both move all the light by a pixel.
  const double light = std::accumulate(photo.grey.begin(), photo.grey.end(), 0.0);
  EXPECT_NEAR(by_simulation / light, 1, 1e-3);
  EXPECT_NEAR(by_flow / light, 1, 1e-3);
}

TEST(PhotoFlow, AContourMovesWithWhatLiesNearer) {
  image::Photo photo;
  photo.width = 4, photo.height = 1;
  photo.mask = {0, 255, 255, 255};
  photo.depth_m = {0, 0.5f, 0.5f, 0.2f};
  const std::vector<float> grey = {0, 100, 100, 200};
  PictureFlow flow;
  flow.move_px = {{0, 0}, {1, 0}, {1, 0}, {3, 0}};
  // Ground and object part by 100 and move by 1 px, the nearer part and the farther one by 3 px.
  EXPECT_THAT(CarriedBy(flow, photo, grey), testing::ElementsAre(-50, -50, -150, -150));
}

TEST(ContourPlaceVariance, GrowsAsContoursLieElsewhere) {
  const absl::StatusOr<Photographs> photographs = MakePhotographs(MakePhotoInput(SmallCamera()), nullptr);
  ASSERT_TRUE(photographs.ok()) << photographs.status();
  const auto variance_at = [&](const std::string& offset) {
    const auto expected = ExpectPhotographs(
        *photographs,
        WithPhotoEffects(model::NominalModel(),
                         {{"image_noise", {"sigma_grey=2"}}, {"principal_point", {"offset_px=" + offset}}}),
        false, nullptr);
    EXPECT_TRUE(expected.ok()) << expected.status();
    return ContourPlaceVariance(*photographs, *expected, nullptr);
  };
  EXPECT_LT(variance_at("0,0"), 1e-3);
  EXPECT_GT(variance_at("0.1,0.1"), 5e-3);
  EXPECT_LT(variance_at("0.1,0.1"), kUnknownPlacePx2);
  EXPECT_DOUBLE_EQ(variance_at("3,3"), kUnknownPlacePx2);
}

}  // namespace
}  // namespace touchstone::diagnosis::images
