// Where the points of a photograph lie, against OpenCV's camera model.
#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include "server/geometry/pose.h"
#include "server/image/photograph/photo_lens.h"
#include "server/image/photograph/photo_test_scene.h"

namespace touchstone::image {
namespace {

// Object frame to camera frame: x right, y down, z forward.
struct CameraPose {
  Eigen::Matrix3d object_from_camera;
  Eigen::Vector3d centre_m;
};
CameraPose PoseOf(const Camera& camera) {
  CameraPose pose;
  const Eigen::Vector3d forward = (camera.at_m - camera.eye_m).normalized();
  const Eigen::Vector3d right = forward.cross(camera.up).normalized();
  pose.object_from_camera << right, forward.cross(right), forward;
  pose.centre_m = camera.eye_m;
  return pose;
}

// OpenCV's projection of points of the object frame; cx and cy count from the picture's corner, as ours do.
std::vector<cv::Point2d> ProjectByOpenCv(const std::vector<Eigen::Vector3d>& points_m, const CameraPose& pose,
                                         const Intrinsics& lens) {
  std::vector<cv::Point3d> in_camera;
  for (const Eigen::Vector3d& point_m : points_m) {
    const Eigen::Vector3d p = pose.object_from_camera.transpose() * (point_m - pose.centre_m);
    in_camera.emplace_back(p.x(), p.y(), p.z());
  }
  const cv::Mat matrix =
      (cv::Mat_<double>(3, 3) << lens.fx_px, 0, lens.cx_px, 0, lens.fy_px, lens.cy_px, 0, 0, 1);
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(in_camera, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), matrix, lens.distortion, pixels);
  return pixels;
}

// Every pixel that sees the object must be where OpenCV projects the point that it sees.
void ExpectProjectionsAtPixels(const Photo& photo, const CameraPose& pose, const Intrinsics& lens) {
  std::vector<Eigen::Vector3d> points_m;
  std::vector<int> seen;
  for (int i = 0; i < photo.width * photo.height; ++i) {
    if (photo.mask[i] == 0) continue;
    points_m.push_back(photo.point_m[i].cast<double>());
    seen.push_back(i);
  }
  ASSERT_GT(seen.size(), 1000u);
  const std::vector<cv::Point2d> pixels = ProjectByOpenCv(points_m, pose, lens);
  double worst_px = 0, worst_depth_m = 0;
  for (size_t k = 0; k < seen.size(); ++k) {
    worst_px = std::max({worst_px, std::abs(pixels[k].x - (seen[k] % photo.width + 0.5)),
                         std::abs(pixels[k].y - (seen[k] / photo.width + 0.5))});
    const double depth_m = pose.object_from_camera.col(2).dot(points_m[k] - pose.centre_m);
    worst_depth_m = std::max(worst_depth_m, std::abs(depth_m - photo.depth_m[seen[k]]));
  }
  // Single precision, at grazing incidence.
  EXPECT_LT(worst_px, 5e-3);
  EXPECT_LT(worst_depth_m, 1e-5);
}

class PhotoProjection : public testing::Test {
 protected:
  PhotoRequest request_ =
      RequestOf(MakeSurface("ball", BallMesh(0.07, 40, 60)), CameraAt({0.12, -0.16, 0.09}), 160, 120);
  CameraPose pose_ = PoseOf(request_.camera);
  Intrinsics lens_ = request_.lens;
};

TEST_F(PhotoProjection, IsOpenCvsWithoutEffects) {
  ExpectProjectionsAtPixels(MustPhotograph(EffectLines{}, request_), pose_, lens_);
}

TEST_F(PhotoProjection, IsOpenCvsWithANominalLensThatDistorts) {
  request_.lens.fx_px *= 1.1;
  request_.lens.distortion = {-0.3, 0.12, 0.004, -0.006, 0.02};
  ExpectProjectionsAtPixels(MustPhotograph(EffectLines{}, request_), pose_, request_.lens);
}

TEST_F(PhotoProjection, FocalErrorScalesBothFocalLengths) {
  lens_.fx_px *= 1.07, lens_.fy_px *= 1.07;
  ExpectProjectionsAtPixels(MustPhotograph({{"focal_error", {"relative=0.07"}}}, request_), pose_, lens_);
}

TEST_F(PhotoProjection, PrincipalPointMovesRightAndDown) {
  lens_.cx_px += 7.25, lens_.cy_px -= 4.5;
  ExpectProjectionsAtPixels(MustPhotograph({{"principal_point", {"offset_px=7.25,-4.5"}}}, request_), pose_,
                            lens_);
}

TEST_F(PhotoProjection, RadialDistortionIsAddedToTheNominalLens) {
  request_.lens.distortion = {0.1, 0.05, 0.003, 0.002};
  lens_.distortion = {0.1 - 0.35, 0.05 + 0.1, 0.003, 0.002};
  ExpectProjectionsAtPixels(MustPhotograph({{"radial_distortion", {"k1=-0.35", "k2=0.1"}}}, request_), pose_,
                            lens_);
  EXPECT_EQ(MustPhotograph({{"radial_distortion", {"k1=0"}}}, request_).grey,
            MustPhotograph(EffectLines{}, request_).grey);
}

TEST_F(PhotoProjection, CameraTranslationIsRightDownForward) {
  pose_.centre_m += pose_.object_from_camera * Eigen::Vector3d(0.012, -0.007, 0.02);
  ExpectProjectionsAtPixels(MustPhotograph({{"camera_translation", {"offset_mm=12,-7,20"}}}, request_), pose_,
                            lens_);
}

TEST_F(PhotoProjection, CameraRotationIsAboutTheCamerasOwnAxes) {
  pose_.object_from_camera *= geometry::RotationFromVector(Eigen::Vector3d(3, -2, 15) * kRadiansPerDegree);
  ExpectProjectionsAtPixels(MustPhotograph({{"camera_rotation", {"rotation_deg=3,-2,15"}}}, request_), pose_,
                            lens_);
}

TEST(PhotoLens, LooksWhereOpenCvUndistortsAPixelTo) {
  Intrinsics nominal = IdealLens(200, 150);
  nominal.fy_px *= 0.93;
  nominal.distortion = {-0.28, 0.09, 0.003, -0.002, -0.01};
  PixelSlopes slopes;
  bool any = false;
  FillSlopes(EffectiveLens(nominal, effects::PhotoSettings()), &slopes, &any);
  EXPECT_TRUE(any);
  std::vector<cv::Point2d> pixels, ideal;
  for (int i = 0; i < 200 * 150; i += 37) pixels.emplace_back(i % 200 + 0.5, i / 200 + 0.5);
  const cv::Mat matrix =
      (cv::Mat_<double>(3, 3) << nominal.fx_px, 0, nominal.cx_px, 0, nominal.fy_px, nominal.cy_px, 0, 0, 1);
  cv::undistortPoints(pixels, ideal, matrix, nominal.distortion, cv::noArray(), cv::noArray(),
                      cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-12));
  for (size_t k = 0; k < pixels.size(); ++k) {
    EXPECT_NEAR(slopes.right[37 * k], ideal[k].x, 1e-7);
    EXPECT_NEAR(slopes.up[37 * k], -ideal[k].y, 1e-7);
  }
}

TEST(PhotoLens, SeesNothingBeyondTheRadiusWhereItFolds) {
  Intrinsics nominal = IdealLens(200, 200);
  nominal.fx_px = nominal.fy_px = 100;
  nominal.distortion = {-0.4, 0, 0, 0};
  const PhotoLens lens = EffectiveLens(nominal, effects::PhotoSettings());
  // r (1 - 0.4 r^2) grows up to r^2 = 1 / 1.2, where it is 2/3 r.
  EXPECT_NEAR(lens.FoldRadiusSquared(), 1 / 1.2, 1e-9);
  const double edge_px = 100 * 2.0 / 3 * std::sqrt(1 / 1.2);
  PixelSlopes slopes;
  bool any = false;
  FillSlopes(lens, &slopes, &any);
  for (int i = 0; i < 200 * 200; ++i) {
    const double radius_px = std::hypot(i % 200 + 0.5 - 100, i / 200 + 0.5 - 100);
    if (std::abs(radius_px - edge_px) < 0.1) continue;
    EXPECT_EQ(std::isnan(slopes.right[i]), radius_px > edge_px) << radius_px;
    if (radius_px < edge_px) {
      const Eigen::Vector2d back = lens.Project({slopes.right[i], -slopes.up[i], 1});
      EXPECT_NEAR((back - Eigen::Vector2d(i % 200 + 0.5, i / 200 + 0.5)).norm(), 0, 1e-3);
    }
  }
}

}  // namespace
}  // namespace touchstone::image
