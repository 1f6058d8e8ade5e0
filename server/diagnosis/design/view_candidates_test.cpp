#include "server/diagnosis/design/view_candidates.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::design {
namespace {

// The first from as high as this, all others from 0.1 m above the object's origin or higher.
images::Photographs PresentPhotographs(double first_z_m) {
  images::HiddenCamera rig;
  rig.objects = {"lat10", "lat20"};
  rig.photographs = 3;
  rig.side_px = 64;
  DiagnosisInput input = images::MakePhotoInput(rig);
  auto set = std::make_shared<session::ImageSet>(*input.images);
  for (session::PhotographRow& row : set->photographs)
    row.commanded.eye_m.z() = row.image == 0 ? first_z_m : std::max(row.commanded.eye_m.z(), 0.1);
  input.images = set;
  auto photographs = images::MakePhotographs(input, nullptr);
  EXPECT_TRUE(photographs.ok()) << photographs.status();
  return *std::move(photographs);
}

// What the simulator shows of a view.
image::Photo PhotoOf(const images::Photographs& photographs, const ViewCandidate& view) {
  const auto first = std::find(photographs.object.begin(), photographs.object.end(), view.object);
  image::PhotoRequest request = photographs.requests[first - photographs.object.begin()];
  request.camera.eye_m = view.camera.eye_m;
  request.camera.at_m = view.camera.at_m;
  request.camera.up = view.camera.up;
  const auto photo = image::PhotoSimulator(std::make_shared<const model::Model>(model::NominalModel()))
                         .Run(request, image::PhotoOutputs(), nullptr);
  EXPECT_TRUE(photo.ok()) << photo.status();
  return *photo;
}

TEST(ListViews, ShowTheWholeObjectOfEveryObject) {
  const images::Photographs photographs = PresentPhotographs(0.1);
  const auto views = ListViews(photographs, 60, 1);
  EXPECT_GE(views.size(), 40u);
  int of_object[2] = {0, 0};
  for (const ViewCandidate& view : views) {
    ++of_object[view.object];
    EXPECT_TRUE(IsInPicture(photographs, view, 0));
    const image::Photo photo = PhotoOf(photographs, view);
    int shown = 0, at_rim = 0;
    for (int y = 0; y < photo.height; ++y)
      for (int x = 0; x < photo.width; ++x) {
        if (photo.mask[static_cast<size_t>(y) * photo.width + x] == 0) continue;
        ++shown;
        at_rim += x == 0 || y == 0 || x == photo.width - 1 || y == photo.height - 1;
      }
    EXPECT_GT(shown, 20);
    EXPECT_EQ(at_rim, 0);
  }
  EXPECT_EQ(of_object[0], of_object[1]);
}

TEST(ListViews, StandAboveTheTableOnlyWhereAllPicturesDo) {
  const images::Photographs above = PresentPhotographs(0.1), all_round = PresentPhotographs(-0.2);
  const auto lowest = [](const images::Photographs& photographs) {
    double z = INFINITY;
    for (const ViewCandidate& view : ListViews(photographs, 60, 1))
      z = std::min(z, view.camera.eye_m.z() - photographs.surfaces[view.object]->bounds().min_m.z());
    return z;
  };
  EXPECT_GT(lowest(above), 0);
  EXPECT_LT(lowest(all_round), 0);
}

TEST(ListViews, HaveSeveralDistancesTurnsAndPlacesInThePicture) {
  const images::Photographs photographs = PresentPhotographs(0.1);
  double nearest = INFINITY, farthest = 0;
  int turned = 0, aside = 0;
  for (const ViewCandidate& view : ListViews(photographs, 60, 1)) {
    const Eigen::Vector3d centre = photographs.surfaces[view.object]->bounds().Centre();
    const double distance_m = (view.camera.eye_m - centre).norm();
    nearest = std::min(nearest, distance_m), farthest = std::max(farthest, distance_m);
    turned += view.camera.up != Eigen::Vector3d::UnitZ();
    aside += (view.camera.at_m - centre).norm() > 0.001;
  }
  EXPECT_GT(farthest, 1.9 * nearest);
  EXPECT_GT(turned, 5);
  EXPECT_GT(aside, 5);
}

TEST(MostDifferentViews, LookFromWhereNothingWasSeenYet) {
  const images::Photographs photographs = PresentPhotographs(0.1);
  const auto views = ListViews(photographs, 60, 1);
  const auto chosen = MostDifferentViews(photographs, views, 4);
  ASSERT_EQ(chosen.size(), 4u);
  EXPECT_EQ(std::count_if(chosen.begin(), chosen.end(), [](const auto& view) { return view.object == 0; }),
            2);
  for (const ViewCandidate& view : chosen) {
    const Eigen::Vector3d centre = photographs.surfaces[view.object]->bounds().Centre();
    for (int k = 0; k < photographs.size(); ++k) {
      if (photographs.object[k] != view.object) continue;
      const Eigen::Vector3d other = photographs.requests[k].camera.eye_m - centre,
                            own = view.camera.eye_m - centre;
      EXPECT_GT(std::hypot(std::acos(own.normalized().dot(other.normalized())),
                           std::log(own.norm() / other.norm())),
                0.4);
    }
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::design
