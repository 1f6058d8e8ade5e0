// Photographs: what they share with the renderer, camera poses, surfaces that effects move, workspaces, noise, errors.
#include "server/image/photograph/simulate_photo.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/geometry/pose.h"
#include "server/image/photograph/photo_test_scene.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

TEST(PhotoSimulator, GivesTheRenderersPictureWithoutEffects) {
  std::string reason;
  const auto renderer = RendererNamed("cpu", &reason);
  ASSERT_NE(renderer, nullptr) << reason;
  // Of an even width: no edge in the middle of a scene runs through pixel centres, where either face is right.
  for (const Scene& scene : Scenes()) {
    SCOPED_TRACE(scene.name);
    const auto surface = MakeSurface(scene.name, scene.mesh);
    PhotoRequest request = RequestOf(surface, scene.camera, 160, 120);
    request.lens = PinholeIntrinsics(160, 120, scene.camera.vertical_fov_rad);
    request.lens.cx_px += 0.5, request.lens.cy_px += 0.5;
    const Photo photo = MustPhotograph(EffectLines{}, request);
    const auto image = renderer->Render(surface, scene.camera, WithAll(160, 120));
    ASSERT_TRUE(image.ok()) << image.status().message();
    int other_mask = 0, other_grey = 0, object = 0;
    for (size_t i = 0; i < image->mask.size(); ++i) {
      object += image->mask[i] != 0;
      if (image->mask[i] != photo.mask[i] || std::abs(image->depth_m[i] - photo.depth_m[i]) > 1e-4) {
        ++other_mask;  // a silhouette through the pixel's centre
        continue;
      }
      other_grey += std::abs(int{image->pixels[i]} - int{photo.pixels[i]}) > 1;
    }
    EXPECT_GT(object, 1000);
    EXPECT_EQ(other_grey, 0);
    EXPECT_LE(other_mask, object / 500);
  }
}

TEST(PhotoSimulator, MovesTheCameraInItsOwnFrame) {
  const auto surface = MakeSurface("letter", LetterMesh());
  const Camera commanded = CameraAt({0.12, -0.26, 0.09});
  const View view = MakeView(commanded, surface->bounds(), WithAll(120, 90));
  // The same by hand: right 5 mm, down 3 mm, forward 8 mm, then turned about the axis (1, 2, 3) deg.
  Eigen::Matrix3d axes;
  axes.col(0) = view.right, axes.col(1) = -view.up, axes.col(2) = view.forward;
  const Eigen::Matrix3d turned =
      axes * geometry::RotationFromVector(Eigen::Vector3d(1, 2, 3) * kRadiansPerDegree);
  Camera real = commanded;
  real.eye_m = commanded.eye_m + axes * Eigen::Vector3d(0.005, 0.003, 0.008);
  real.at_m = real.eye_m + turned.col(2);
  real.up = -turned.col(1);
  const Photo expected = MustPhotograph(EffectLines{}, RequestOf(surface, real));
  const Photo photo = MustPhotograph(
      {{"camera_translation", {"offset_mm=5,3,8"}}, {"camera_rotation", {"rotation_deg=1,2,3"}}},
      RequestOf(surface, commanded));
  int other = 0;
  for (size_t i = 0; i < photo.depth_m.size(); ++i)
    other += std::abs(photo.depth_m[i] - expected.depth_m[i]) > 1e-6;
  EXPECT_LE(other, 3);
  // Lights stay where the commanded camera has them: they are those of another picture than the moved camera's.
  double largest = 0;
  for (size_t i = 0; i < photo.light.size(); ++i)
    if (photo.mask[i] && expected.mask[i])
      largest = std::max<double>(largest, std::abs(photo.light[i] - expected.light[i]));
  EXPECT_GT(largest, 0.005);
}

TEST(PhotoSimulator, ShowsASurfaceThatEffectsMove) {
  geometry::TriangleMesh mesh = LetterMesh();
  const auto surface = MakeSurface("letter", mesh);
  const Eigen::Matrix3d turn = geometry::RotationFromVector(Eigen::Vector3d(4, -3, 10) * kRadiansPerDegree);
  for (Eigen::Vector3f& vertex : mesh.vertices_m)
    vertex = (turn * (1.05 * vertex.cast<double>()) + Eigen::Vector3d(0.004, 0.006, -0.002)).cast<float>();
  const auto moved = MakeSurface("moved", mesh);
  const PhotoRequest request = RequestOf(surface, CameraAt({0.12, -0.26, 0.09}));
  PhotoRequest of_moved = RequestOf(moved, request.camera);
  const Photo photo = MustPhotograph({{"object_scale", {"relative=0.05"}},
                                      {"object_pose", {"translation_mm=4,6,-2", "rotation_deg=4,-3,10"}}},
                                     request);
  const Photo expected = MustPhotograph(EffectLines{}, of_moved);
  int other = 0, object = 0;
  for (size_t i = 0; i < photo.depth_m.size(); ++i) {
    object += photo.mask[i] != 0;
    other += std::abs(photo.depth_m[i] - expected.depth_m[i]) > 1e-6;
    if (photo.mask[i] != 0 && expected.mask[i] != 0 &&
        std::abs(photo.depth_m[i] - expected.depth_m[i]) < 1e-6) {
      EXPECT_NEAR(photo.incidence_rad[i], expected.incidence_rad[i], 1e-3);
    }
  }
  EXPECT_GT(object, 1000);
  EXPECT_LE(other, 3);
}

TEST(PhotoSimulator, KeepsNothingInAWorkspaceThatAnotherModelChanges) {
  const auto letter = MakeSurface("letter", LetterMesh()), ball = MakeSurface("ball", BallMesh(0.07, 14, 20));
  const std::vector<EffectLines> models = {
      {},
      {{"camera_translation", {"offset_mm=1,0,0"}}},
      {{"focal_error", {"relative=0.02"}}},
      {{"light_position", {"offset_mm=30,0,0"}}},
      {{"cast_shadow", {"strength=1"}}},
      {{"light_position", {"offset_mm=30,0,0"}}, {"cast_shadow", {"strength=1"}}},
      {{"specular", {"strength=0.5"}}},
      {{"radial_distortion", {"k1=-0.2"}}},
      {{"exposure", {"stops=1"}}, {"image_noise", {"sigma_grey=3"}}},
      {{"object_pose", {"translation_mm=0,0,3"}}},
      {{"background_level", {"grey=9"}}},
  };
  PhotoWorkspace workspace;
  for (size_t i = 0; i < 3 * models.size(); ++i) {
    const auto model = PhotoModel(models[i * 7 % models.size()]);
    const PhotoRequest request = RequestOf(i % 4 == 3 ? ball : letter, CameraAt({0.12, -0.26, 0.09}));
    const Photo kept = MustPhotograph(model, request, &workspace), anew = MustPhotograph(model, request);
    EXPECT_EQ(kept.grey, anew.grey) << i;
    EXPECT_EQ(kept.pixels, anew.pixels) << i;
    EXPECT_EQ(kept.mask, anew.mask) << i;
  }
}

TEST(PhotoSimulator, IsTheSameWhateverTheThreads) {
  const auto surface = MakeSurface("letter", LetterMesh());
  const auto model = PhotoModel({{"radial_distortion", {"k1=-0.2"}},
                                 {"cast_shadow", {"strength=1"}},
                                 {"specular", {"strength=0.4"}},
                                 {"defocus_blur", {"sigma_px=0.7"}},
                                 {"image_noise", {"sigma_grey=3"}}});
  const PhotoRequest request = RequestOf(surface, CameraAt({0.12, -0.26, 0.09}));
  const Photo alone = MustPhotograph(model, request);
  std::vector<Photo> photos(4);
  std::vector<std::thread> threads;
  for (Photo& photo : photos) threads.emplace_back([&] { photo = MustPhotograph(model, request); });
  for (std::thread& thread : threads) thread.join();
  for (const Photo& photo : photos) {
    EXPECT_EQ(photo.pixels, alone.pixels);
    EXPECT_EQ(photo.grey, alone.grey);
  }
}

TEST(PhotoSimulator, AddsWhatFormulasAndLookupsSayToRecordedPixels) {
  PhotoRequest request = RequestOf(MakeSurface("letter", LetterMesh()), CameraAt({0.12, -0.26, 0.09}));
  request.session_time_s = 50;
  const EffectLines gamma = {{"gamma", {"exponent=0.8"}}};
  EffectLines lines = gamma;
  lines.push_back({"formula",
                   {"name=odd", "adds=grey",
                    "expression=k*incidence_deg + depth_mm/100 - column/9 + row/7 + "
                    "session_time_s/50 - grey/8",
                    "k=0.1", "k_unit=1", "k_min=0", "k_max=1"}});
  lines.push_back({"lookup", {"name=dirt", "adds=grey", "covariate=radius", "knots=0,1", "values=0,-20"}});
  const Photo plain = MustPhotograph(gamma, request), photo = MustPhotograph(lines, request);
  for (int i = 0; i < 120 * 90; ++i) {
    const double column = i % 120 + 0.5, row = i / 120 + 0.5;
    const double incidence_deg = plain.mask[i] != 0 ? plain.incidence_rad[i] / kRadiansPerDegree : 90;
    double grey = plain.grey[i] + 0.1 * incidence_deg + 10 * plain.depth_m[i] - column / 9 + row / 7 + 1 -
                  plain.grey[i] / 8;
    grey = std::clamp(grey, 0.0, 255.0) - 20 * std::hypot(column - 60, row - 45) / 75;
    EXPECT_NEAR(photo.grey[i], std::clamp(grey, 0.0, 255.0), 1e-3);
  }
  const auto broken =
      PhotoSimulator(PhotoModel({{"formula", {"name=bad", "adds=grey", "expression=log(column-9)"}}}))
          .Run(request, {}, nullptr);
  EXPECT_THAT(std::string(broken.status().message()), HasSubstr("row 0, column 0"));
}

TEST(PhotoSimulator, RefusesWhatNoCameraSees) {
  const auto surface = MakeSurface("letter", LetterMesh());
  const PhotoRequest good = RequestOf(surface, CameraAt({0.12, -0.26, 0.09}));
  const auto error = [](const PhotoRequest& request) {
    return std::string(PhotoSimulator(PhotoModel({})).Run(request, {}, nullptr).status().message());
  };
  EXPECT_EQ(error(good), "");
  PhotoRequest request = good;
  request.surface = nullptr;
  EXPECT_THAT(error(request), HasSubstr("surface"));
  request = good, request.lens.fx_px = 0;
  EXPECT_THAT(error(request), HasSubstr("lens.fx_px is 0"));
  request = good, request.lens.width = 0;
  EXPECT_THAT(error(request), HasSubstr("lens.width is 0"));
  request = good, request.lens.distortion = {1, 2, 3};
  EXPECT_THAT(error(request), HasSubstr("3 coefficients"));
  request = good, request.lens.distortion = {0, 0, 0, NAN};
  EXPECT_THAT(error(request), HasSubstr("coefficient nan"));
  request = good, request.camera.at_m = request.camera.eye_m;
  EXPECT_THAT(error(request), HasSubstr("camera.at_m"));
  // The axis passes far outside the picture, where this lens folds.
  request = good, request.lens.distortion = {-2, 0, 0, 0}, request.lens.cx_px = 1e5;
  EXPECT_THAT(error(request), HasSubstr("sees nothing"));
}

}  // namespace
}  // namespace touchstone::image
