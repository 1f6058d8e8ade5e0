#include "server/image/scene/shading_mesh.h"

#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "server/image/renderers/test_scene.h"
#include "server/image/scene/shading.h"

namespace touchstone::image {
namespace {

geometry::TriangleMesh CubeMesh() {
  geometry::TriangleMesh mesh;
  AddBox({-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}, &mesh);
  return mesh;
}

Eigen::Vector3d NormalOf(const ShadingMesh::Vertex& vertex) {
  return {vertex.normal[0], vertex.normal[1], vertex.normal[2]};
}
Eigen::Vector3d PositionOf(const ShadingMesh::Vertex& vertex) {
  return {vertex.position_m[0], vertex.position_m[1], vertex.position_m[2]};
}

// The normal of triangle t as its corners are wound.
Eigen::Vector3d FaceNormal(const ShadingMesh& mesh, size_t t) {
  const Eigen::Vector3d a = PositionOf(mesh.vertices[mesh.corners[3 * t]]);
  return (PositionOf(mesh.vertices[mesh.corners[3 * t + 1]]) - a)
      .cross(PositionOf(mesh.vertices[mesh.corners[3 * t + 2]]) - a)
      .normalized();
}

TEST(ShadingMesh, SplitsACubeIntoItsFaces) {
  const ShadingMesh mesh = MakeShadingMesh(*MakeSurface("cube", CubeMesh()));
  EXPECT_TRUE(mesh.outward);
  EXPECT_EQ(mesh.corners.size(), 36u);
  EXPECT_EQ(mesh.vertices.size(), 24u);  // four per face
  for (size_t corner = 0; corner < mesh.corners.size(); ++corner)
    EXPECT_NEAR(NormalOf(mesh.vertices[mesh.corners[corner]]).dot(FaceNormal(mesh, corner / 3)), 1, 1e-6);
}

TEST(ShadingMesh, SmoothsABall) {
  const ShadingMesh mesh = MakeShadingMesh(*MakeSurface("ball", BallMesh(0.05, 48, 96)));
  EXPECT_TRUE(mesh.outward);
  EXPECT_EQ(mesh.vertices.size(), 47u * 96 + 2);  // none split
  for (const ShadingMesh::Vertex& vertex : mesh.vertices) {
    EXPECT_NEAR(NormalOf(vertex).norm(), 1, 1e-6);
    EXPECT_GT(NormalOf(vertex).dot(PositionOf(vertex).normalized()), 0.999);
  }
}

TEST(ShadingMesh, SplitsExactlyBeyondTheCrease) {
  // Two squares that meet along the y axis at a dihedral turn of `turn_rad`.
  const auto vertices_at = [](double turn_rad) {
    geometry::TriangleMesh mesh;
    const float x = static_cast<float>(std::cos(turn_rad)), z = static_cast<float>(-std::sin(turn_rad));
    mesh.vertices_m = {{-1, 0, 0}, {0, 0, 0}, {0, 1, 0}, {-1, 1, 0}, {x, 0, z}, {x, 1, z}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}};
    return MakeShadingMesh(*MakeSurface("roof", mesh)).vertices.size();
  };
  EXPECT_EQ(vertices_at(kCreaseRad - 0.01), 6u);
  EXPECT_EQ(vertices_at(kCreaseRad + 0.01), 8u);
}

TEST(ShadingMesh, WeldsPositionsThatTheFileRepeats) {
  const geometry::TriangleMesh ball = BallMesh(0.05, 24, 48);
  geometry::TriangleMesh soup;  // as an STL file has it: three vertices per triangle
  for (const auto& triangle : ball.triangles) {
    const uint32_t first = static_cast<uint32_t>(soup.vertices_m.size());
    for (uint32_t vertex : triangle) soup.vertices_m.push_back(ball.vertices_m[vertex]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  const ShadingMesh mesh = MakeShadingMesh(*MakeSurface("soup", soup));
  EXPECT_EQ(mesh.vertices.size(), ball.vertices_m.size());
  EXPECT_TRUE(mesh.outward);
}

TEST(ShadingMesh, TurnsWhatIsInsideOut) {
  const ShadingMesh mesh = MakeShadingMesh(*MakeSurface("inside out", InsideOut(CubeMesh())));
  EXPECT_TRUE(mesh.outward);
  for (size_t t = 0; t < mesh.corners.size() / 3; ++t)
    EXPECT_GT(FaceNormal(mesh, t).dot(PositionOf(mesh.vertices[mesh.corners[3 * t]])), 0);
}

TEST(ShadingMesh, IsNotOutwardWhereBackFacesShow) {
  EXPECT_FALSE(MakeShadingMesh(*MakeSurface("bowl", BowlMesh())).outward);
  // One of two spheres inside out: every edge is closed and consistent, only rays tell.
  geometry::TriangleMesh pair = BallMesh(0.05, 24, 48);
  const geometry::TriangleMesh second = InsideOut(BallMesh(0.03, 24, 48));
  const uint32_t first = static_cast<uint32_t>(pair.vertices_m.size());
  for (const Eigen::Vector3f& vertex : second.vertices_m)
    pair.vertices_m.push_back(vertex + Eigen::Vector3f(0.1f, 0, 0));
  for (const auto& t : second.triangles) pair.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  EXPECT_FALSE(MakeShadingMesh(*MakeSurface("pair", pair)).outward);
}

TEST(ShadingMeshCache, ComputesOnceForAllThreads) {
  ShadingMeshCache cache;
  const std::shared_ptr<const geometry::Surface> surface = MakeSurface("ball", BallMesh(0.05, 48, 96));
  std::vector<std::shared_ptr<const ShadingMesh>> meshes(4);
  std::vector<std::thread> threads;
  for (auto& mesh : meshes) threads.emplace_back([&] { mesh = cache.Get(surface); });
  for (std::thread& thread : threads) thread.join();
  for (const auto& mesh : meshes) EXPECT_EQ(mesh.get(), meshes[0].get());
  EXPECT_EQ(cache.size(), 1u);
}

TEST(ShadingMeshCache, ForgetsDeadSurfacesAndTheOldest) {
  ShadingMeshCache cache;
  std::vector<std::shared_ptr<const geometry::Surface>> surfaces;
  for (size_t i = 0; i < ShadingMeshCache::kMaxEntries + 3; ++i) {
    surfaces.push_back(MakeSurface("cube", CubeMesh()));
    cache.Get(surfaces.back());
  }
  EXPECT_EQ(cache.size(), ShadingMeshCache::kMaxEntries);
  const std::weak_ptr<const ShadingMesh> kept = cache.Get(surfaces.back());
  EXPECT_FALSE(kept.expired());
  surfaces.resize(1);
  cache.Get(surfaces[0]);
  EXPECT_EQ(cache.size(), 1u);
  EXPECT_TRUE(kept.expired());
}

}  // namespace
}  // namespace touchstone::image
