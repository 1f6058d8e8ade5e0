#include "tests/hidden_effects/generator/solid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace touchstone::hidden {
namespace {

using Vec = Eigen::Vector3d;

Solid Plate() {
  return Solid("plate",
               {{{-500, -500, 0}, {500, -500, 0}, {500, 500, 0}, {-500, 500, 0}}, {{0, 1, 2}, {0, 2, 3}}});
}

TEST(Solid, ABallOnAPlaneComesEarlyByTheClosedForm) {
  const Solid plate = Plate();
  for (const double incidence : {0.0, 0.2, 0.7, 1.2}) {
    const Vec a(std::sin(incidence), 0, -std::cos(incidence));
    const Contact point = plate.FirstContact(Vec(3, 4, 20) - 30 * a, a, 0);
    const Contact ball = plate.FirstContact(Vec(3, 4, 20) - 30 * a, a, 2);
    ASSERT_TRUE(point.hit && ball.hit);
    EXPECT_NEAR(point.travel_mm, 30 + 20 / std::cos(incidence), 1e-9);
    EXPECT_NEAR(ball.travel_mm, point.travel_mm - 2 * (1 / std::cos(incidence) - 1), 1e-9);
    EXPECT_NEAR(ball.outward.z(), 1, 1e-12);
  }
}

TEST(Solid, ABallRollsOverEdgesAndCorners) {
  // The edge of the plate at x = 500: a ball of 10 mm whose centre passes 6 mm beside it.
  const Solid plate = Plate();
  const Contact edge = plate.FirstContact(Vec(506, 0, 100), -Vec::UnitZ(), 10);
  ASSERT_TRUE(edge.hit);
  EXPECT_NEAR(edge.travel_mm, 100 + 10 - 8, 1e-9);
  EXPECT_NEAR((edge.outward - Vec(0.6, 0, 0.8)).norm(), 0, 1e-12);
  // The corner at (500, 500): 2 mm and 3 mm beside it.
  const Contact corner = plate.FirstContact(Vec(502, 503, 100), -Vec::UnitZ(), 7);
  ASSERT_TRUE(corner.hit);
  EXPECT_NEAR(corner.travel_mm, 100 + 7 - std::sqrt(49.0 - 13), 1e-9);
  EXPECT_FALSE(plate.FirstContact(Vec(508, 503, 100), -Vec::UnitZ(), 7).hit);
}

TEST(Solid, TheTreeFindsWhatEveryTriangleTells) {
  const Solid solid("lat10", SupershapeTriangles("lat10", 2000));
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  int hits = 0;
  for (int k = 0; k < 400; ++k) {
    const Vec a = Vec(normal(random), normal(random), normal(random)).normalized();
    const Vec start = Vec(normal(random), normal(random), normal(random)) * 40 - 200 * a;
    const double radius = k % 4;
    const Contact fast = solid.FirstContact(start, a, radius),
                  slow = solid.FirstContactOfAll(start, a, radius);
    ASSERT_EQ(fast.hit, slow.hit);
    if (!fast.hit) continue;
    EXPECT_EQ(fast.travel_mm, slow.travel_mm);
    ++hits;
  }
  EXPECT_GT(hits, 200);
}

}  // namespace
}  // namespace touchstone::hidden
