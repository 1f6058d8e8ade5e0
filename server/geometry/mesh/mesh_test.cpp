#include "server/geometry/mesh/mesh.h"

#include <gtest/gtest.h>

#include <limits>

namespace touchstone::geometry {
namespace {

// A tetrahedron at a right-angled corner, legs of 1 m, wound outwards.
TriangleMesh Tetrahedron() {
  TriangleMesh mesh;
  mesh.vertices_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  return mesh;
}

TEST(Mesh, BoundsHoldTheTrianglesAndNoStrayVertex) {
  TriangleMesh mesh = Tetrahedron();
  mesh.vertices_m.emplace_back(100, 100, 100);
  const Bounds bounds = ComputeBounds(mesh);
  EXPECT_EQ(bounds.min_m, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(bounds.max_m, Eigen::Vector3d(1, 1, 1));
  EXPECT_EQ(InspectMesh(mesh).unused_vertices, 1u);
}

TEST(Mesh, BoundsOfNothingAreInsideOut) {
  const Bounds bounds = ComputeBounds(TriangleMesh());
  EXPECT_GT(bounds.min_m.x(), bounds.max_m.x());
}

TEST(Mesh, ReportsAClosedBody) {
  const MeshReport report = InspectMesh(Tetrahedron());
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.vertices, 4u);
  EXPECT_EQ(report.triangles, 4u);
  EXPECT_EQ(report.inconsistent_edges, 0u);
  EXPECT_EQ(report.degenerate_triangles, 0u);
  EXPECT_EQ(report.duplicate_triangles, 0u);
  EXPECT_NEAR(report.signed_volume_m3, 1.0 / 6.0, 1e-15);
}

TEST(Mesh, VolumeIsNegativeInsideOutAndKeepsItsDigitsFarAway) {
  TriangleMesh mesh = Tetrahedron();
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_NEAR(InspectMesh(mesh).signed_volume_m3, -1.0 / 6.0, 1e-15);
  for (auto& vertex_m : mesh.vertices_m) vertex_m += Eigen::Vector3f::Constant(4096);
  EXPECT_NEAR(InspectMesh(mesh).signed_volume_m3, -1.0 / 6.0, 1e-12);
}

TEST(Mesh, AMissingTriangleLeavesThreeBoundaryEdges) {
  TriangleMesh mesh = Tetrahedron();
  mesh.triangles.pop_back();
  EXPECT_EQ(InspectMesh(mesh).boundary_edges, 3u);
  EXPECT_FALSE(InspectMesh(mesh).closed());
}

TEST(Mesh, AFlippedTriangleMakesItsThreeEdgesInconsistent) {
  TriangleMesh mesh = Tetrahedron();
  std::swap(mesh.triangles[2][0], mesh.triangles[2][1]);
  EXPECT_EQ(InspectMesh(mesh).inconsistent_edges, 3u);
  EXPECT_TRUE(InspectMesh(mesh).closed());
}

TEST(Mesh, AFinOnAnEdgeIsNonmanifold) {
  TriangleMesh mesh = Tetrahedron();
  mesh.vertices_m.emplace_back(2, 2, 2);
  mesh.triangles.push_back({0, 1, 4});
  EXPECT_EQ(InspectMesh(mesh).nonmanifold_edges, 1u);
  EXPECT_EQ(InspectMesh(mesh).boundary_edges, 2u);
}

TEST(Mesh, ASoupIsJudgedByItsPlaces) {
  // Every triangle with vertices of its own, as an STL holds them, and zeros of both signs.
  const TriangleMesh tetrahedron = Tetrahedron();
  TriangleMesh soup;
  for (const auto& triangle : tetrahedron.triangles) {
    const uint32_t first = static_cast<uint32_t>(soup.vertices_m.size());
    for (uint32_t corner : triangle) {
      Eigen::Vector3f place_m = tetrahedron.vertices_m[corner];
      if (first % 2 == 0 && place_m.x() == 0) place_m.x() = -0.0f;
      soup.vertices_m.push_back(place_m);
    }
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  EXPECT_TRUE(InspectMesh(soup).closed());
  soup.triangles.push_back({1, 2, 0});
  EXPECT_EQ(InspectMesh(soup).duplicate_triangles, 1u);
}

TEST(Mesh, DropsTrianglesWithoutAreaAndRepeatedOnesInOrder) {
  TriangleMesh mesh = Tetrahedron();
  mesh.vertices_m.emplace_back(0.5f, 0.5f, 0);  // 4: on the edge from 1 to 2
  mesh.vertices_m.emplace_back(1, 0, 0);        // 5: where 1 is
  mesh.triangles = {{0, 2, 1}, {1, 2, 4},       // collinear
                    {0, 1, 3}, {3, 0, 1},       // the one before, turned
                    {0, 3, 1},                  // and inside out
                    {3, 5, 0},                  // and by an equal vertex
                    {1, 1, 3},                  // repeated index
                    {1, 5, 3},                  // repeated place
                    {0, 3, 2}};
  const TriangleMesh clean = WithoutDegenerateAndDuplicate(mesh);
  const std::vector<std::array<uint32_t, 3>> expected = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}};
  EXPECT_EQ(clean.triangles, expected);
  EXPECT_EQ(clean.vertices_m.size(), mesh.vertices_m.size());
  const MeshReport report = InspectMesh(mesh);
  EXPECT_EQ(report.degenerate_triangles, 3u);
  EXPECT_EQ(report.duplicate_triangles, 4u);  // the two without area that share their places are one of them
}

TEST(Mesh, KeepsNeedlesThatHaveAnArea) {
  TriangleMesh mesh;
  mesh.vertices_m = {{0, 0, 0}, {1, 0, 0}, {0.5f, std::numeric_limits<float>::denorm_min(), 0}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(WithoutDegenerateAndDuplicate(mesh).triangles.size(), 1u);
}

TEST(Mesh, HashTellsMeshesApart) {
  const TriangleMesh mesh = Tetrahedron();
  EXPECT_EQ(MeshHash(mesh).size(), 64u);
  EXPECT_EQ(MeshHash(mesh), MeshHash(Tetrahedron()));
  TriangleMesh moved = mesh;
  moved.vertices_m[3].z() = std::nextafter(1.0f, 2.0f);
  EXPECT_NE(MeshHash(mesh), MeshHash(moved));
  TriangleMesh turned = mesh;
  std::swap(turned.triangles[0], turned.triangles[1]);
  EXPECT_NE(MeshHash(mesh), MeshHash(turned));
  // One vertex's bytes read as a triangle's must not make the same mesh.
  TriangleMesh shifted = mesh;
  shifted.vertices_m.pop_back();
  shifted.triangles.insert(shifted.triangles.begin(), {0, 0, 0x3F800000u});
  EXPECT_NE(MeshHash(mesh), MeshHash(shifted));
}

}  // namespace
}  // namespace touchstone::geometry
