#include "server/geometry/mesh/winding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/geometry/shapes/supershape.h"

namespace touchstone::geometry {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// A tetrahedron with edges of `side` along the axes from `corner`, wound outwards.
TriangleMesh Tetrahedron(const Eigen::Vector3f& corner, float side) {
  TriangleMesh mesh;
  for (const Eigen::Vector3f& at : {Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(1, 0, 0),
                                    Eigen::Vector3f(0, 1, 0), Eigen::Vector3f(0, 0, 1)})
    mesh.vertices_m.push_back(corner + side * at);
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

TriangleMesh Joined(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh both = a;
  both.vertices_m.insert(both.vertices_m.end(), b.vertices_m.begin(), b.vertices_m.end());
  for (auto triangle : b.triangles) {
    for (uint32_t& corner : triangle) corner += static_cast<uint32_t>(a.vertices_m.size());
    both.triangles.push_back(triangle);
  }
  return both;
}

TriangleMesh InsideOut(TriangleMesh mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  return mesh;
}

TEST(WronglyWound, FindsAPartThatIsInsideOut) {
  const TriangleMesh one = Tetrahedron({0, 0, 0}, 0.05f), other = Tetrahedron({0.2f, 0, 0}, 0.05f);
  EXPECT_THAT(WronglyWound(Joined(one, other)), IsEmpty());
  TriangleMesh mesh = Joined(one, InsideOut(other));
  EXPECT_THAT(WronglyWound(mesh), ElementsAre(4, 5, 6, 7));
  EXPECT_NEAR(InspectMesh(mesh).signed_volume_m3, 0, 1e-11);
  Turn(WronglyWound(mesh), &mesh);
  EXPECT_THAT(WronglyWound(mesh), IsEmpty());
  EXPECT_NEAR(InspectMesh(mesh).signed_volume_m3, 2 * 0.05 * 0.05 * 0.05 / 6, 1e-10);
  EXPECT_THAT(WronglyWound(InsideOut(one)), ElementsAre(0, 1, 2, 3));
}

TEST(WronglyWound, FindsTrianglesThatFaceTheOtherWayThanTheirNeighbours) {
  TriangleMesh mesh = *MakeSupershape(*NamedSupershape("lat20"), 500);
  EXPECT_THAT(WronglyWound(mesh), IsEmpty());
  for (const uint32_t t : {0, 7, 8, 100}) std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
  EXPECT_THAT(WronglyWound(mesh), ElementsAre(0, 7, 8, 100));
}

TEST(WronglyWound, LeavesCavitiesAndOpenSurfaces) {
  const TriangleMesh outer = Tetrahedron({0, 0, 0}, 0.1f), inner = Tetrahedron({0.01f, 0.01f, 0.01f}, 0.02f);
  EXPECT_THAT(WronglyWound(Joined(outer, InsideOut(inner))), IsEmpty());
  EXPECT_THAT(WronglyWound(Joined(outer, inner)), IsEmpty());
  TriangleMesh open = InsideOut(outer);
  open.triangles.pop_back();
  EXPECT_THAT(WronglyWound(open), IsEmpty());
}

}  // namespace
}  // namespace touchstone::geometry
