// Polygons against what must hold of any triangulation: n - 2 triangles, all turning the polygon's way,
// together of the polygon's area, and hence without overlap.
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <numeric>

#include "server/base/numbers/random.h"
#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using Triangles = std::vector<std::array<uint32_t, 3>>;

std::vector<uint32_t> AllOf(const Points& points) {
  std::vector<uint32_t> corners(points.size());
  std::iota(corners.begin(), corners.end(), 0u);
  return corners;
}

Triangles Split(const Points& points, const std::vector<uint32_t>& polygon) {
  Triangles triangles;
  uint64_t work = 0;
  Triangulate(points, polygon, &triangles, &work);
  return triangles;
}

// Twice the signed area of flat polygons in the xy plane.
double Area(const Points& p, const std::vector<uint32_t>& polygon) {
  double area = 0;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3d &a = p[polygon[i]], &b = p[polygon[(i + 1) % polygon.size()]];
    area += a.x() * b.y() - a.y() * b.x();
  }
  return area;
}

void ExpectTiles(const Points& points, const std::vector<uint32_t>& polygon) {
  const Triangles triangles = Split(points, polygon);
  ASSERT_EQ(triangles.size(), polygon.size() - 2);
  const double whole = Area(points, polygon);
  double sum = 0, absolute = 0;
  for (const auto& triangle : triangles) {
    const double area = Area(points, {triangle[0], triangle[1], triangle[2]});
    sum += area;
    absolute += std::abs(area);
  }
  EXPECT_NEAR(sum, whole, 1e-9 * std::abs(whole));
  EXPECT_NEAR(absolute, std::abs(whole), 1e-9 * std::abs(whole)) << "triangles overlap";
}

TEST(Triangulate, ConvexFacesBecomeFans) {
  const Points square = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  EXPECT_EQ(Split(square, {0, 1, 2, 3}), (Triangles{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(Split(square, {2, 1, 0}), (Triangles{{2, 1, 0}}));
}

TEST(Triangulate, AnArrowHeadIsSplitAtItsNotch) {
  const Points arrow = {
      {0, 0, 0}, {2, -1, 0}, {0.5, 0, 0}, {2, 1, 0}};  // a fan from corner 1 or 3 would be wrong
  for (uint32_t first = 0; first < 4; ++first)
    ExpectTiles(arrow, {first, (first + 1) % 4, (first + 2) % 4, (first + 3) % 4});
}

TEST(Triangulate, CombsAndSpiralsAreTiled) {
  Points comb = {{0, 0, 0}, {20, 0, 0}};
  for (int tooth = 10; tooth > 0; --tooth) {
    comb.emplace_back(2 * tooth - 0.5, 5, 0);
    comb.emplace_back(2 * tooth - 1, 0.5, 0);
  }
  comb.emplace_back(0, 5, 0);
  ExpectTiles(comb, AllOf(comb));
  Points spiral;
  for (int i = 0; i <= 200; ++i)
    spiral.emplace_back((1 + i * 0.05) * std::cos(i * 0.1), (1 + i * 0.05) * std::sin(i * 0.1), 0);
  for (int i = 200; i >= 0; --i)
    spiral.emplace_back((0.7 + i * 0.05) * std::cos(i * 0.1), (0.7 + i * 0.05) * std::sin(i * 0.1), 0);
  ExpectTiles(spiral, AllOf(spiral));
}

TEST(Triangulate, RandomStarsAreTiledBothWaysRound) {
  for (uint64_t k = 0; k < 300; ++k) {
    RandomStream random(7, RandomDomain::kTest, k);
    Points star;
    const int n = 4 + static_cast<int>(random.Below(60));
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * M_PI * i / n, radius = random.Uniform(0.05, 1);
      star.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0);
    }
    std::vector<uint32_t> polygon = AllOf(star);
    ExpectTiles(star, polygon);
    std::reverse(polygon.begin(), polygon.end());
    ExpectTiles(star, polygon);
  }
}

TEST(Triangulate, CornersOnStraightEdgesLeaveNoNeedles) {
  // A square with two more corners on every side: every triangle can have an area.
  Points square;
  const double x[] = {0, 1, 1, 0};
  const double y[] = {0, 0, 1, 1};
  for (int side = 0; side < 4; ++side)
    for (double along : {0.0, 0.25, 0.5}) {
      const int next = (side + 1) % 4;
      square.emplace_back(x[side] + along * (x[next] - x[side]), y[side] + along * (y[next] - y[side]), 0);
    }
  ExpectTiles(square, AllOf(square));
  for (const auto& t : Split(square, AllOf(square)))
    EXPECT_FALSE(IsDegenerate(square[t[0]], square[t[1]], square[t[2]]))
        << t[0] << " " << t[1] << " " << t[2];
}

TEST(Triangulate, AHoleOnABridgeStaysAHole) {
  // A frame: outer square, bridge to the inner one, round it the other way, and back over the bridge.
  const Points frame = {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0},
                        {1, 1, 0}, {1, 3, 0}, {3, 3, 0}, {3, 1, 0}};
  ExpectTiles(frame, {0, 1, 2, 3, 0, 4, 5, 6, 7, 4});
  EXPECT_NEAR(Area(frame, {0, 1, 2, 3, 0, 4, 5, 6, 7, 4}), 2 * (16 - 4), 1e-12);
}

TEST(Triangulate, TiltedFacesKeepTheirWinding) {
  const Eigen::Vector3d u = Eigen::Vector3d(1, 2, 3).normalized(), v = Eigen::Vector3d(-2, 1, 0).normalized();
  Points arrow;
  for (const auto& [a, b] : {std::pair{0.0, 0.0}, {2.0, -1.0}, {0.5, 0.0}, {2.0, 1.0}})
    arrow.push_back(Eigen::Vector3d(10, 20, 30) + a * u + b * v);
  const Eigen::Vector3d normal = u.cross(v);
  for (const auto& t : Split(arrow, {1, 2, 3, 0}))
    EXPECT_GT((arrow[t[1]] - arrow[t[0]]).cross(arrow[t[2]] - arrow[t[0]]).dot(normal), 0);
}

TEST(Triangulate, AnswersEvenForFacesThatAreNone) {
  const Points line = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  EXPECT_EQ(Split(line, {0, 1, 2, 3}).size(), 2u);
  EXPECT_EQ(Split(line, {0, 0, 0, 0, 0}).size(), 3u);
  const Points bow_tie = {{0, 0, 0}, {2, 2, 0}, {2, 0, 0}, {0, 1, 0}, {5, 5, 0}};
  EXPECT_EQ(Split(bow_tie, {0, 1, 2, 3}).size(), 2u);
  EXPECT_EQ(Split(bow_tie, {0, 1, 2, 3, 4}).size(), 3u);
  for (uint64_t k = 0; k < 200; ++k) {
    RandomStream random(8, RandomDomain::kTest, k);
    std::vector<uint32_t> scribble(4 + random.Below(40));
    for (uint32_t& corner : scribble) corner = static_cast<uint32_t>(random.Below(5));
    EXPECT_EQ(Split(bow_tie, scribble).size(), scribble.size() - 2);
  }
}

TEST(Triangulate, StopsThinkingWhenAFileAsksTooMuch) {
  // Half a million corners in random order: answered at once, and the work tells the caller to refuse.
  Points points;
  RandomStream random(9, RandomDomain::kTest);
  for (int i = 0; i < 500'000; ++i) points.emplace_back(random.Uniform(), random.Uniform(), 0);
  Triangles triangles;
  uint64_t work = 0;
  Triangulate(points, AllOf(points), &triangles, &work);
  EXPECT_EQ(triangles.size(), points.size() - 2);
  EXPECT_GT(work, kMaxTriangulationWork);
}

}  // namespace
}  // namespace touchstone::geometry
