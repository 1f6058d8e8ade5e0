#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/numbers/nan.h"
#include "server/base/units.h"
#include "server/image/renderers/renderer.h"
#include "server/image/scene/view.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

Camera GoodCamera() {
  Camera camera;
  camera.eye_m = {0.3, 0, 0};
  return camera;
}

geometry::Bounds BoxOf(double half_m) {
  geometry::Bounds bounds;
  bounds.min_m = Eigen::Vector3d::Constant(-half_m);
  bounds.max_m = Eigen::Vector3d::Constant(half_m);
  return bounds;
}

void ExpectRefused(const Camera& camera, const ImageOptions& options, const char* field, const char* right) {
  const absl::Status status = ValidateImageRequest(camera, options);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << field;
  EXPECT_THAT(std::string(status.message()), HasSubstr(field));
  EXPECT_THAT(std::string(status.message()), HasSubstr(right));
}

TEST(Camera, OfATouchStandsWhereTheMiddleFingerStarts) {
  // Approach along -x, fingers along y: up is s x a = y x (-x) = z.
  const Camera camera = CameraOfTouch({0.01, 0.02, 0.03}, {-1, 0, 0}, {0, 1, 0}, 0.25);
  EXPECT_TRUE(camera.eye_m.isApprox(Eigen::Vector3d(0.26, 0.02, 0.03)));
  EXPECT_TRUE(camera.at_m.isApprox(Eigen::Vector3d(0.01, 0.02, 0.03)));
  EXPECT_TRUE(camera.up.isApprox(Eigen::Vector3d(0, 0, 1)));
  EXPECT_DOUBLE_EQ(camera.vertical_fov_rad, kPi / 4);
}

TEST(Camera, OfATouchShowsTheFirstFingerOnTheLeft) {
  // The lateral vector runs from the first finger to the last; in the image it points to the right.
  const Eigen::Vector3d approach(-1, 0, 0), lateral(0, 1, 0);
  const View view = MakeView(CameraOfTouch({0, 0, 0}, approach, lateral, 0.3), BoxOf(0.05), {});
  EXPECT_NEAR(view.right.dot(lateral), 1, 1e-12);
  EXPECT_LT(view.Project(-0.03 * lateral).x(), 112);
  EXPECT_GT(view.Project(0.03 * lateral).x(), 112);
}

TEST(View, ProjectsKnownPoints) {
  ImageOptions options;
  options.width = 400;
  options.height = 200;
  Camera camera = GoodCamera();  // at (0.3, 0, 0), looks along -x, z up: +y is to the right
  camera.vertical_fov_rad = kPi / 2;
  const View view = MakeView(camera, BoxOf(0.05), options);
  // At depth 0.3 the image's half height of 100 pixels is 0.3 m.
  const Eigen::Vector2d centre = view.Project({0, 0, 0});
  EXPECT_NEAR(centre.x(), 200, 1e-9);
  EXPECT_NEAR(centre.y(), 100, 1e-9);
  const Eigen::Vector2d right_and_up = view.Project({0, 0.15, 0.3});
  EXPECT_NEAR(right_and_up.x(), 250, 1e-9);
  EXPECT_NEAR(right_and_up.y(), 0, 1e-9);
  EXPECT_NEAR(view.DepthM({0.1, 0.7, -0.2}), 0.2, 1e-12);
}

TEST(View, PixelVectorsAndProjectionAreInverse) {
  Camera camera;
  camera.eye_m = {0.2, -0.3, 0.1};
  camera.at_m = {0.01, 0.02, -0.03};
  camera.up = {0.1, 0.2, 3};
  ImageOptions options;
  options.width = 31;
  options.height = 17;
  const View view = MakeView(camera, BoxOf(0.05), options);
  for (const auto& [x, y] : {std::pair(0, 0), std::pair(30, 16), std::pair(7, 3)}) {
    const Eigen::Vector3d vector = view.PixelVector(x, y);
    EXPECT_NEAR(vector.dot(view.forward), 1, 1e-12);
    const Eigen::Vector2d pixel = view.Project(view.eye_m + 0.37 * vector);
    EXPECT_NEAR(pixel.x(), x + 0.5, 1e-9);
    EXPECT_NEAR(pixel.y(), y + 0.5, 1e-9);
  }
  EXPECT_GT(view.up.dot(camera.up), 0);
  EXPECT_NEAR(view.right.cross(view.up).dot(-view.forward), 1, 1e-12);
}

TEST(View, PlanesEncloseTheObjectUnlessSet) {
  const geometry::Bounds box = BoxOf(0.05);
  const double radius_m = 0.05 * std::sqrt(3.0);
  Camera camera = GoodCamera();
  View view = MakeView(camera, box, {});
  EXPECT_LE(view.near_m, 0.3 - radius_m);
  EXPECT_GE(view.far_m, 0.3 + radius_m);
  EXPECT_GT(view.near_m, 0.3 - 1.01 * radius_m);
  // Inside the object the near plane stays before the eye.
  camera.eye_m = {0.01, 0, 0};
  view = MakeView(camera, box, {});
  EXPECT_GT(view.near_m, 0);
  EXPECT_LT(view.near_m, 1e-4);
  EXPECT_GE(view.far_m, 0.01 + radius_m);
  // Behind the eye there is nothing to enclose, but the planes are in order.
  camera.eye_m = {0.3, 0, 0};
  camera.at_m = {0.4, 0, 0};
  view = MakeView(camera, box, {});
  EXPECT_GT(view.near_m, 0);
  EXPECT_LT(view.near_m, view.far_m);
  camera.near_m = 0.2;
  camera.far_m = 0.5;
  view = MakeView(camera, box, {});
  EXPECT_EQ(view.near_m, 0.2);
  EXPECT_EQ(view.far_m, 0.5);
}

TEST(View, BoxOfPixelsHoldsEveryCorner) {
  const geometry::Bounds box = BoxOf(0.02);
  Camera camera = GoodCamera();
  camera.eye_m = {0.3, 0.2, 0.1};
  camera.at_m = {0, 0.05, 0};
  const View view = MakeView(camera, box, {});
  const PixelBox pixels = ProjectBounds(view, box);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d point((corner & 1) ? 0.02 : -0.02, (corner & 2) ? 0.02 : -0.02,
                                (corner & 4) ? 0.02 : -0.02);
    const Eigen::Vector2d pixel = view.Project(point);
    EXPECT_GE(pixel.x(), pixels.first_column);
    EXPECT_LE(pixel.x(), pixels.last_column);
    EXPECT_GE(pixel.y(), pixels.first_row);
    EXPECT_LE(pixel.y(), pixels.last_row);
  }
  EXPECT_LT((pixels.last_column - pixels.first_column) * (pixels.last_row - pixels.first_row), 224 * 224 / 4);
}

TEST(ImageRequest, AcceptsTheLargestAndTheSmallest) {
  ImageOptions options;
  options.width = 1;
  options.height = kMaxImageSide;
  EXPECT_TRUE(ValidateImageRequest(GoodCamera(), options).ok());
}

TEST(ImageRequest, RefusesSizesByName) {
  ImageOptions options;
  options.width = 0;
  ExpectRefused(GoodCamera(), options, "width is 0", "from 1 to 2048");
  options.width = 20000;
  ExpectRefused(GoodCamera(), options, "width is 20000", "from 1 to 2048");
  options.width = 224;
  options.height = -5;
  ExpectRefused(GoodCamera(), options, "height is -5", "from 1 to 2048");
}

TEST(ImageRequest, RefusesCamerasThatSeeNothing) {
  Camera camera = GoodCamera();
  camera.eye_m.y() = kNaN;
  ExpectRefused(camera, {}, "camera.eye_m is (0.3, nan, 0)", "finite");
  camera = GoodCamera();
  camera.at_m.x() = std::numeric_limits<double>::infinity();
  ExpectRefused(camera, {}, "camera.at_m is (inf, 0, 0)", "finite");
  camera = GoodCamera();
  camera.at_m = camera.eye_m;
  ExpectRefused(camera, {}, "camera.at_m is (0.3, 0, 0), the same as camera.eye_m", "another point");
  camera = GoodCamera();
  camera.up = {0, 0, 0};
  ExpectRefused(camera, {}, "camera.up is (0, 0, 0)", "not zero");
  camera.up = {0, kNaN, 0};
  ExpectRefused(camera, {}, "camera.up is (0, nan, 0)", "finite");
  camera.up = {-2, 0, 0};
  ExpectRefused(camera, {}, "camera.up is (-2, 0, 0), parallel", "image's top");
  camera = GoodCamera();
  camera.vertical_fov_rad = kPi;
  ExpectRefused(camera, {}, "camera.vertical_fov_rad is 3.14159", "170 deg");
  camera.vertical_fov_rad = kNaN;
  ExpectRefused(camera, {}, "camera.vertical_fov_rad is nan", "170 deg");
  camera = GoodCamera();
  camera.near_m = -1;
  ExpectRefused(camera, {}, "camera.near_m is -1", "greater than 0");
  camera.near_m = 2;
  camera.far_m = 1;
  ExpectRefused(camera, {}, "camera.near_m is 2", "less than camera.far_m, 1");
}

}  // namespace
}  // namespace touchstone::image
