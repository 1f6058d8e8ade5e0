// The CPU renderer's two ways to find the triangle in a pixel must find the same one.
#include <gtest/gtest.h>

#include "server/image/renderers/cpu_frame.h"
#include "server/image/renderers/test_scene.h"

namespace touchstone::image {
namespace {

struct Case {
  const char* name;
  geometry::TriangleMesh mesh;
  Camera camera;
  int width;
  int height;
};

std::vector<Case> Cases() {
  return {{"letter", LetterMesh(), CameraAt({0.12, -0.26, 0.09}), 224, 224},
          {"axis view", LetterMesh(), CameraAt({0, -0.3, 0}), 224, 224},
          {"fine ball", BallMesh(0.07, 100, 100), CameraAt({0.1, 0.15, -0.1}), 224, 224},
          {"coarse ball, large", BallMesh(0.07, 10, 12), CameraAt({0.1, 0.15, -0.1}), 701, 499},
          {"bowl", BowlMesh(), CameraAt({0.05, 0.08, 0.2}), 131, 77},
          {"triangles far below a pixel", BallMesh(0.07, 100, 100), CameraAt({0.1, 0.15, -0.1}), 23, 19},
          {"beside the image", BallMesh(0.07, 40, 40), CameraAt({0.1, 0.05, 0.02}), 96, 96}};
}

TEST(Visibility, OfDrawnTrianglesIsThatOfRays) {
  for (const Case& one : Cases()) {
    SCOPED_TRACE(one.name);
    const auto surface = MakeSurface(one.name, one.mesh);
    const ShadingMesh mesh = MakeShadingMesh(*surface);
    ImageOptions options;
    options.width = one.width;
    options.height = one.height;
    const CpuFrame frame = MakeCpuFrame(*surface, mesh, one.camera, options);
    ASSERT_TRUE(CanDrawTriangles(frame));
    Visibility cast(frame.box), drawn(frame.box);
    CastPixels(frame, &cast);
    DrawTriangles(frame, BestKernels(), &drawn);
    int hits = 0, different = 0;
    for (int y = frame.box.first_row; y < frame.box.last_row; ++y) {
      for (int x = frame.box.first_column; x < frame.box.last_column; ++x) {
        const uint32_t a = cast.Row(y)[x - frame.box.first_column],
                       b = drawn.Row(y)[x - frame.box.first_column];
        hits += a != geometry::kNoTriangle;
        if (a == b) continue;
        ++different;
        EXPECT_FALSE(IsSteady(surface->mesh(), frame.view, x + 0.5, y + 0.5, 2e-3, true)) << x << ", " << y;
      }
    }
    EXPECT_GT(hits, 50);
    EXPECT_LE(different, 2 + hits / 100);
  }
}

TEST(Visibility, HasNoHoleInAClosedSurface) {
  // Every pixel whose centre lies well inside the silhouette of a sphere must be covered, whatever edges
  // cross it.
  const auto surface = MakeSurface("ball", BallMesh(0.07, 180, 200));
  const ShadingMesh mesh = MakeShadingMesh(*surface);
  ImageOptions options;
  options.width = options.height = 600;
  for (int i = 0; i < 6; ++i) {
    const Camera camera = CameraAt({0.2 * std::cos(i), 0.2 * std::sin(i), 0.03 * i});
    const CpuFrame frame = MakeCpuFrame(*surface, mesh, camera, options);
    Visibility drawn(frame.box);
    DrawTriangles(frame, BestKernels(), &drawn);
    for (int y = frame.box.first_row; y < frame.box.last_row; ++y) {
      for (int x = frame.box.first_column; x < frame.box.last_column; ++x) {
        const Eigen::Vector3d ray = frame.view.PixelVector(x, y).normalized();
        const double off_axis_m = frame.view.eye_m.cross(ray).norm();
        const bool covered = drawn.Row(y)[x - frame.box.first_column] != geometry::kNoTriangle;
        if (off_axis_m < 0.0695) {
          ASSERT_TRUE(covered) << i << ": " << x << ", " << y;
        } else if (off_axis_m > 0.0701) {
          ASSERT_FALSE(covered) << i << ": " << x << ", " << y;
        }
      }
    }
  }
}

TEST(Visibility, IsCastWhereTrianglesWouldNeedClipping) {
  const auto surface = MakeSurface("ball", BallMesh(0.07, 14, 20));
  const ShadingMesh mesh = MakeShadingMesh(*surface);
  Camera cut = CameraAt({0.2, 0, 0});
  cut.near_m = 0.2;
  EXPECT_FALSE(CanDrawTriangles(MakeCpuFrame(*surface, mesh, cut, {})));
  EXPECT_FALSE(CanDrawTriangles(MakeCpuFrame(*surface, mesh, CameraAt({0.01, 0, 0}), {})));
  EXPECT_FALSE(CanDrawTriangles(MakeCpuFrame(*surface, mesh, CameraAt({50, 0, 0}), {})));
  EXPECT_TRUE(CanDrawTriangles(MakeCpuFrame(*surface, mesh, CameraAt({0.2, 0, 0}), {})));
}

}  // namespace
}  // namespace touchstone::image
