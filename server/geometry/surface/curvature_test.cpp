#include <gtest/gtest.h>

#include <thread>

#include "server/geometry/surface/brute_force_oracle.h"
#include "server/geometry/surface/surface.h"

namespace touchstone::geometry {
namespace {

Vector3d Middle(const TriangleMesh& mesh, uint32_t t) {
  return (mesh.Corner(t, 0) + mesh.Corner(t, 1) + mesh.Corner(t, 2)) / 3;
}

TriangleMesh InsideOut(TriangleMesh mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  return mesh;
}

// Open at both ends.
TriangleMesh Tube(double radius_m, int around, int along, double step_m) {
  TriangleMesh mesh;
  for (int i = 0; i <= along; ++i) {
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * 3.141592653589793 * j / around;
      mesh.vertices_m.push_back(
          Vector3d(radius_m * std::cos(angle), radius_m * std::sin(angle), i * step_m).cast<float>());
    }
  }
  const auto at = [&](int i, int j) { return static_cast<uint32_t>(i * around + j % around); };
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < around; ++j) {
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      mesh.triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return mesh;
}

TEST(MeanCurvature, OfABallIsOneOverItsRadius) {
  const auto ball = *Surface::Create("ball", Sphere(0.04, 40));
  for (uint32_t t = 0; t < ball->mesh().triangles.size(); ++t)
    ASSERT_NEAR(ball->MeanCurvaturePerM(t, Middle(ball->mesh(), t)), 25, 0.5) << t;
}

TEST(MeanCurvature, OfAHollowIsNegative) {
  const auto hollow = *Surface::Create("hollow", InsideOut(Sphere(0.04, 40)));
  for (uint32_t t = 0; t < hollow->mesh().triangles.size(); ++t)
    ASSERT_NEAR(hollow->MeanCurvaturePerM(t, Middle(hollow->mesh(), t)), -25, 0.5) << t;
}

TEST(MeanCurvature, OfATubeIsHalfOfOneOverItsRadiusAndNothingOnTheBorder) {
  const auto tube = *Surface::Create("tube", Tube(0.02, 100, 30, 0.0013));
  const TriangleMesh& mesh = tube->mesh();
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const double z = Middle(mesh, t).z();
    if (z > 0.003 && z < 0.036) {
      ASSERT_NEAR(tube->MeanCurvaturePerM(t, Middle(mesh, t)), 25, 0.3) << t;
    }
    for (int c = 0; c < 3; ++c) {
      const Vector3d corner = mesh.Corner(t, c);
      if (corner.z() == 0) {
        EXPECT_EQ(tube->MeanCurvaturePerM(t, corner), 0);
      }
    }
  }
}

TEST(MeanCurvature, IsFiniteOnAnyMesh) {
  TriangleMesh needles = Soup(200, 0.01, 1);
  for (size_t v = 0; v < needles.vertices_m.size(); v += 3)
    needles.vertices_m[v] = needles.vertices_m[v + 1] + Eigen::Vector3f(1e-7f, 0, 0);
  for (const TriangleMesh& mesh : {needles, Awkward(), Soup(500, 0.02, 2)}) {
    const auto surface = *Surface::Create("any", mesh);
    for (uint32_t t = 0; t < surface->mesh().triangles.size(); ++t)
      ASSERT_TRUE(std::isfinite(surface->MeanCurvaturePerM(t, Middle(surface->mesh(), t))));
  }
}

TEST(MeanCurvature, MayBeAskedByManyThreadsAtOnce) {
  const auto ball = *Surface::Create("ball", Sphere(0.04, 20));
  std::vector<std::thread> threads;
  std::atomic<int> wrong{0};
  for (int n = 0; n < 4; ++n) {
    threads.emplace_back([&] {
      for (uint32_t t = 0; t < 1000; ++t)
        wrong += !(std::fabs(ball->MeanCurvaturePerM(t, Middle(ball->mesh(), t)) - 25) < 1);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace touchstone::geometry
