#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"
#include "server/geometry/surface/surface.h"

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

// Points spread over the faces of the cube, each met at `cosine`.
TouchBatch CubeTouches(int size, double cosine) {
  TouchBatch touches = TestBatch(size, 3);
  RandomStream random(3, RandomDomain::kTest);
  for (size_t i = 0; i < touches.contact_m.size(); ++i) {
    Eigen::Vector3d point(random.Uniform(-0.05, 0.05), random.Uniform(-0.05, 0.05),
                          random.Uniform(-0.05, 0.05));
    const uint64_t face = random.Below(6);
    point[face / 2] = face % 2 == 0 ? 0.05 : -0.05;
    touches.contact_m[i] = point;
    touches.cos_incidence[i] = cosine;
  }
  return touches;
}

std::vector<double> Earlier(const TouchBatch& before, const TouchBatch& after) {
  std::vector<double> earlier;
  for (size_t i = 0; i < before.travel_m.size(); ++i)
    earlier.push_back(before.travel_m[i] - after.travel_m[i]);
  return earlier;
}

double Rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / values.size());
}

TEST(SurfaceError, HasItsRmsOverTheSurfaceForEverySeedAndLength) {
  const TouchBatch before = CubeTouches(4000, 1);
  for (const uint64_t seed : {1, 2, 3}) {
    for (const double length_mm : {5.0, 20.0, 200.0}) {
      TouchBatch after = before;
      after.seed = seed;
      ApplyByName("surface_error", {{"rms_mm", {0.2}}, {"length_mm", {length_mm}}}, &after);
      EXPECT_NEAR(Rms(Earlier(before, after)), 0.2e-3, 0.01e-3)
          << "seed " << seed << ", length " << length_mm;
    }
  }
}

TEST(SurfaceError, ShortensTravelByHeightOverCosine) {
  const TouchBatch head_on = CubeTouches(50, 1);
  const TouchBatch oblique = CubeTouches(50, 0.5);
  TouchBatch after_head_on = head_on;
  TouchBatch after_oblique = oblique;
  ApplyByName("surface_error", {{"rms_mm", {0.2}}}, &after_head_on);
  ApplyByName("surface_error", {{"rms_mm", {0.2}}}, &after_oblique);
  const std::vector<double> height_m = Earlier(head_on, after_head_on);
  const std::vector<double> earlier_m = Earlier(oblique, after_oblique);
  for (size_t i = 0; i < height_m.size(); ++i) EXPECT_NEAR(earlier_m[i], 2 * height_m[i], 1e-15);
}

TEST(SurfaceError, MovesAndTurnsWithTheObject) {
  TouchBatch before = CubeTouches(50, 1);
  TouchBatch after = before;
  ApplyByName("surface_error", {{"rms_mm", {0.2}}}, &after);
  TouchBatch moved_before = before;
  ApplyByName("object_scale", {{"relative", {0.05}}}, &moved_before);
  ApplyByName("object_pose", {{"translation_mm", {4, 5, -6}}, {"rotation_deg", {10, 20, 30}}}, &moved_before);
  for (Eigen::Vector3d& point : moved_before.contact_m)
    point = moved_before.surface_translation_m +
            moved_before.surface_rotation * (moved_before.surface_scale * point);
  TouchBatch moved_after = moved_before;
  ApplyByName("surface_error", {{"rms_mm", {0.2}}}, &moved_after);
  const std::vector<double> here = Earlier(before, after);
  const std::vector<double> there = Earlier(moved_before, moved_after);
  for (size_t i = 0; i < here.size(); ++i) EXPECT_NEAR(here[i], there[i], 1e-12);
}

TEST(SurfaceError, DiffersFromObjectToObjectAndFromSeedToSeed) {
  const TouchBatch before = CubeTouches(50, 1);
  TouchBatch cube = before;
  TouchBatch other_name = before;
  other_name.surface = *geometry::Surface::Create("another", TestCube()->mesh());
  TouchBatch other_seed = before;
  other_seed.seed = 99;
  for (TouchBatch* touches : {&cube, &other_name, &other_seed})
    ApplyByName("surface_error", {{"rms_mm", {0.2}}}, touches);
  EXPECT_NE(cube.travel_m, other_name.travel_m);
  EXPECT_NE(cube.travel_m, other_seed.travel_m);
}

}  // namespace
}  // namespace touchstone::effects
