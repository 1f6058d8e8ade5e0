#include <gtest/gtest.h>

#include <cstring>
#include <numeric>
#include <thread>

#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/geometry/shapes/supershape.h"
#include "server/geometry/surface/brute_force_oracle.h"
#include "server/geometry/surface/surface.h"

namespace touchstone::geometry {
namespace {

constexpr double kLongestSweepM = 1.0;
constexpr double kUnderMicrometreM = 1e-6;

std::shared_ptr<const Surface> MakeSurface(const TriangleMesh& mesh) {
  return *Surface::Create("test", mesh);
}

Contacts Sweep(const Surface& surface, const Vector3d& origin, const Vector3d& direction, double radius_m) {
  Contacts contacts;
  surface.SweepSpheres({&origin, 1}, {&direction, 1}, radius_m, kLongestSweepM, &contacts);
  return contacts;
}

// Compares with the oracle, and checks that point and normal belong to the contact.
void ExpectOracle(const TriangleMesh& mesh, const Lines& lines, double radius_m) {
  const auto surface = MakeSurface(mesh);
  Contacts contacts;
  surface->SweepSpheres(lines.origins_m, lines.directions, radius_m, kLongestSweepM, &contacts);
  double worst = 0;
  int touched = 0;
  for (size_t i = 0; i < lines.origins_m.size(); ++i) {
    const Vector3d& direction = lines.directions[i];
    const Vector3d start = lines.origins_m[i] - radius_m * direction;
    const double expected = BruteForceBall(surface->mesh(), start, direction, radius_m, kLongestSweepM);
    if (contacts.triangle[i] == kNoTriangle || !std::isfinite(expected)) {
      // A grazing sphere may go either way: then one that is a nanometre larger or smaller does.
      if ((contacts.triangle[i] == kNoTriangle) == std::isinf(expected)) continue;
      EXPECT_NE(
          std::isinf(BruteForceBall(surface->mesh(), start, direction, radius_m + 1e-9, kLongestSweepM)),
          std::isinf(BruteForceBall(surface->mesh(), start, direction, radius_m - 1e-9, kLongestSweepM)))
          << "line " << i << ", expected " << expected;
      continue;
    }
    ++touched;
    const double off = std::fabs(contacts.travel_m[i] - expected);
    // A sphere that first slips by an edge: how far it goes then depends on the last nanometre of its radius.
    if (off > kUnderMicrometreM) {
      const double larger =
          BruteForceBall(surface->mesh(), start, direction, radius_m + 1e-9, kLongestSweepM);
      const double smaller =
          BruteForceBall(surface->mesh(), start, direction, radius_m - 1e-9, kLongestSweepM);
      EXPECT_TRUE(larger - 1e-9 <= contacts.travel_m[i] && contacts.travel_m[i] <= smaller + 1e-9)
          << "line " << i << ": " << contacts.travel_m[i] << ", expected " << expected;
      continue;
    }
    worst = std::max(worst, off);
    if (contacts.travel_m[i] == 0) continue;
    const Vector3d centre = start + contacts.travel_m[i] * direction;
    EXPECT_NEAR((centre - contacts.point_m[i]).norm(), radius_m, 1e-9);
    EXPECT_LT((centre - contacts.point_m[i] - radius_m * contacts.normal[i]).norm(), 1e-9);
    const uint32_t t = contacts.triangle[i];
    EXPECT_LT(DistanceToTriangle(contacts.point_m[i], surface->mesh().Corner(t, 0),
                                 surface->mesh().Corner(t, 1), surface->mesh().Corner(t, 2)),
              1e-9);
  }
  EXPECT_GT(touched, static_cast<int>(lines.origins_m.size() / 3));
  std::printf("  radius %g mm: worst of %d: %.3g nm\n", radius_m * 1e3, touched, worst * 1e9);
}

TEST(SweepSpheres, OnAPlaneIsEarlyByRadiusOverCosineLessRadius) {
  const auto plate = MakeSurface(Box({-0.2f, -0.2f, -0.1f}, {0.2f, 0.2f, 0.0f}));
  for (const double angle : {0.0, 0.1, 0.5, 1.0, 1.3}) {
    for (const double radius_m : {0.0001, 0.002, 0.005}) {
      const Vector3d direction(std::sin(angle), 0, -std::cos(angle));
      const Vector3d origin = Vector3d(0.0123, 0.0077, 0) - 0.1 * direction;
      const Contacts contacts = Sweep(*plate, origin, direction, radius_m);
      EXPECT_NEAR(contacts.travel_m[0], 0.1 - (radius_m / std::cos(angle) - radius_m), 1e-12);
      EXPECT_NEAR((contacts.normal[0] - Vector3d::UnitZ()).norm(), 0, 1e-12);
      EXPECT_NEAR(contacts.point_m[0].z(), 0, 1e-12);
    }
  }
}

TEST(SweepSpheres, OnAnEdgeFollowsTheCircleRoundIt) {
  const auto box = MakeSurface(Box({0, -0.2f, -0.2f}, {0.2f, 0.2f, 0}));  // an edge along y at x = z = 0
  const double radius_m = 0.004;
  for (const double beside_m : {0.0005, 0.002, 0.0039}) {
    const Contacts contacts = Sweep(*box, {-beside_m, 0.013, 0.1}, {0, 0, -1}, radius_m);
    const double up_m = std::sqrt(radius_m * radius_m - beside_m * beside_m);
    EXPECT_NEAR(contacts.travel_m[0], 0.1 + radius_m - up_m, 1e-12);
    EXPECT_NEAR((contacts.point_m[0] - Vector3d(0, 0.013, 0)).norm(), 0, 1e-12);
    EXPECT_NEAR(contacts.normal[0].x(), -beside_m / radius_m, 1e-9);
  }
  EXPECT_EQ(Sweep(*box, {-0.004001, 0.013, 0.1}, {0, 0, -1}, radius_m).triangle[0], kNoTriangle);
}

TEST(SweepSpheres, OnACornerFollowsTheBallRoundIt) {
  const auto box = MakeSurface(Box({0, 0, -0.2f}, {0.2f, 0.2f, 0}));
  const double radius_m = 0.005;
  const Contacts contacts = Sweep(*box, {-0.002, -0.003, 0.1}, {0, 0, -1}, radius_m);
  EXPECT_NEAR(contacts.travel_m[0], 0.1 + radius_m - std::sqrt(0.000025 - 0.000004 - 0.000009), 1e-12);
  EXPECT_NEAR(contacts.point_m[0].norm(), 0, 1e-12);
  EXPECT_EQ(Sweep(*box, {-0.004, -0.003001, 0.1}, {0, 0, -1}, radius_m).triangle[0], kNoTriangle);
}

TEST(SweepSpheres, OnABallActsLikeAPointOnALargerBall) {
  const double ball_m = 0.05;
  const auto ball = MakeSurface(Sphere(ball_m, 120));  // facets stand at most 6 um below the sphere
  for (const double radius_m : {0.001, 0.005}) {
    for (const double beside_m : {0.0, 0.01, 0.03, 0.045}) {
      const double sum_m = ball_m + radius_m;
      const double expected = 0.2 + radius_m - std::sqrt(sum_m * sum_m - beside_m * beside_m);
      EXPECT_NEAR(Sweep(*ball, {beside_m, 0, 0.2}, {0, 0, -1}, radius_m).travel_m[0], expected, 3e-5);
    }
  }
}

TEST(SweepSpheres, ThatStartOnTheSurfaceHaveTravelZero) {
  const auto box = MakeSurface(Box({-0.1f, -0.1f, -0.1f}, {0.1f, 0.1f, 0}));
  // The centre starts 3 mm above the face, 5 mm is the radius; it moves away, along and into the surface.
  for (const Vector3d& direction : {Vector3d(0, 0, 1), Vector3d(1, 0, 0), Vector3d(0, 0, -1)}) {
    const Vector3d origin = Vector3d(0.01, 0.02, 0.003) + 0.005 * direction;
    const Contacts contacts = Sweep(*box, origin, direction, 0.005);
    EXPECT_EQ(contacts.travel_m[0], 0);
    EXPECT_NEAR((contacts.point_m[0] - Vector3d(0.01, 0.02, 0)).norm(), 0, 1e-12);
    EXPECT_NEAR((contacts.normal[0] - Vector3d::UnitZ()).norm(), 0, 1e-12);
  }
}

TEST(SweepSpheres, AgreeWithTheDistanceToEveryTriangle) {
  const std::vector<std::pair<const char*, TriangleMesh>> meshes = {
      {"lat20", *MakeSupershape(*NamedSupershape("lat20"), 3000)},
      {"lat00", *MakeSupershape(*NamedSupershape("lat00"), 3000)},
      {"cube", Box({-0.05f, -0.05f, -0.05f}, {0.05f, 0.05f, 0.05f})},
      {"awkward", Awkward()},
      {"soup", Soup(100, 0.03, 11)},
      {"dense soup", Soup(3000, 0.002, 12)},
  };
  for (const auto& [name, mesh] : meshes) {
    SCOPED_TRACE(name);
    std::printf("%s\n", name);
    for (const double radius_m : {0.0003, 0.003, 0.02})
      ExpectOracle(mesh, AimedLines(mesh, SecondTierRuns() && !kUnderSanitizers ? 300 : 30, 13), radius_m);
  }
}

TEST(SweepSpheres, HangOnNothingButTheLine) {
  for (const TriangleMesh& mesh :
       {*MakeSupershape(*NamedSupershape("lat10"), 5000), Awkward(), Soup(500, 0.01, 3)}) {
    const auto surface = MakeSurface(mesh);
    const Lines lines = AimedLines(surface->mesh(), 2000, 14);
    Contacts whole;
    surface->SweepSpheres(lines.origins_m, lines.directions, 0.003, kLongestSweepM, &whole);
    std::vector<size_t> order(2000);
    std::iota(order.begin(), order.end(), 0);
    std::mt19937 random(1);
    std::shuffle(order.begin(), order.end(), random);
    // Some come twice in a row, and are swept once.
    for (size_t i = 2; i < order.size(); i += 3) order[i] = order[i - 1];
    std::vector<Vector3d> origins, directions;
    for (const size_t i : order) {
      origins.push_back(lines.origins_m[i]);
      directions.push_back(lines.directions[i]);
    }
    const auto fresh = MakeSurface(surface->mesh());
    std::atomic<int> different{0};
    std::vector<std::thread> threads;
    for (int n = 0; n < 4; ++n) {
      threads.emplace_back([&, n] {
        Contacts part;
        const size_t begin = 500 * n;
        fresh->SweepSpheres(absl::MakeSpan(origins).subspan(begin, 500),
                            absl::MakeSpan(directions).subspan(begin, 500), 0.003, kLongestSweepM, &part);
        for (size_t i = 0; i < 500; ++i) {
          const size_t j = order[begin + i];
          different += std::memcmp(&part.travel_m[i], &whole.travel_m[j], sizeof(double)) != 0 ||
                       std::memcmp(&part.normal[i], &whole.normal[j], sizeof(Vector3d)) != 0 ||
                       part.triangle[i] != whole.triangle[j];
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(different, 0);
  }
}

}  // namespace
}  // namespace touchstone::geometry
