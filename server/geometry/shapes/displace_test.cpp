#include "server/geometry/shapes/displace.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/geometry/shapes/supershape.h"

namespace touchstone::geometry {
namespace {

TriangleMesh CubeToMove() {
  TriangleMesh mesh;
  for (const float z : {-0.05f, 0.05f})
    for (const float y : {-0.05f, 0.05f})
      for (const float x : {-0.05f, 0.05f}) mesh.vertices_m.emplace_back(x, y, z);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

double LongestEdge(const TriangleMesh& mesh) {
  double longest = 0;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int c = 0; c < 3; ++c)
      longest = std::max(longest, (mesh.Corner(t, c) - mesh.Corner(t, (c + 1) % 3)).norm());
  return longest;
}

TEST(WithShortEdges, KeepsTheSurfaceAndClosesIt) {
  const TriangleMesh mesh = *WithShortEdges(CubeToMove(), 0.007, 1000000);
  EXPECT_LE(LongestEdge(mesh), 0.007);
  const MeshReport report = InspectMesh(mesh);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.inconsistent_edges, 0u);
  EXPECT_NEAR(report.signed_volume_m3, 1e-3, 1e-9);
  double area = 0;
  for (const double own : AreaOfVertices(mesh)) area += own;
  EXPECT_NEAR(area, 0.06, 1e-8);
}

TEST(WithShortEdges, RefusesWhatWouldTakeTooManyTriangles) {
  EXPECT_EQ(WithShortEdges(CubeToMove(), 1e-4, 1000).status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_FALSE(WithShortEdges(CubeToMove(), 0, 1000).ok());
}

TEST(MovedAlongNormals, MovesFacesEdgesAndCornersOfACubeToALargerCube) {
  const TriangleMesh mesh = MovedAlongNormals(*WithShortEdges(CubeToMove(), 0.02, 1000000),
                                              [](const Eigen::Vector3d&) { return 0.001; });
  const Bounds bounds = ComputeBounds(mesh);
  EXPECT_NEAR(bounds.max_m.x(), 0.051, 1e-7);
  EXPECT_NEAR(bounds.min_m.z(), -0.051, 1e-7);
  EXPECT_NEAR(InspectMesh(mesh).signed_volume_m3, std::pow(0.102, 3), 1e-8);
}

TEST(MovedAlongNormals, MovesASmoothSurfaceAlongItsNormals) {
  const TriangleMesh before = *MakeSupershape(*NamedSupershape("lat00"), 20000);
  const TriangleMesh after = MovedAlongNormals(before, [](const Eigen::Vector3d&) { return 0.0005; });
  double area_m2 = 0;
  for (const double own : AreaOfVertices(before)) area_m2 += own;
  const double grown = InspectMesh(after).signed_volume_m3 - InspectMesh(before).signed_volume_m3;
  EXPECT_NEAR(grown, area_m2 * 0.0005, 0.05 * area_m2 * 0.0005);
}

TEST(MovedAlongNormals, KeepsTogetherWhatLiesAtOnePlace) {
  TriangleMesh soup;  // every triangle with vertices of its own
  const TriangleMesh cube = CubeToMove();
  for (uint32_t t = 0; t < cube.triangles.size(); ++t) {
    const uint32_t first = static_cast<uint32_t>(soup.vertices_m.size());
    for (int c = 0; c < 3; ++c) soup.vertices_m.push_back(cube.vertices_m[cube.triangles[t][c]]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  const TriangleMesh moved = MovedAlongNormals(*WithShortEdges(soup, 0.03, 100000),
                                               [](const Eigen::Vector3d& p) { return 0.001 * p.x() / 0.05; });
  EXPECT_TRUE(InspectMesh(moved).closed());
}

}  // namespace
}  // namespace touchstone::geometry
