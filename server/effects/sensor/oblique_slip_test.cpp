#include <gtest/gtest.h>
#include <cmath>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ObliqueSlip, AddsTravelTimesTheTangentOfTheIncidence) {
  TouchBatch before = TestBatch(3, 1);
  before.speed_m_s = {0.02, 0.02, 0.02};
  before.time_per_travel_s_m = {50, 50, 50};
  before.cos_incidence = {1, std::cos(45 * kRadiansPerDegree), std::cos(60 * kRadiansPerDegree)};
  TouchBatch after = before;
  ApplyByName("oblique_slip", {{"travel_mm", {0.5}}}, &after);
  EXPECT_DOUBLE_EQ(after.reported_time_s[0], before.reported_time_s[0]);
  EXPECT_NEAR(after.reported_time_s[1] - before.reported_time_s[1], 0.0005 / 0.02, 1e-14);
  EXPECT_NEAR(after.reported_time_s[2] - before.reported_time_s[2], 0.0005 / 0.02 * std::sqrt(3.0), 1e-14);
}

TEST(ObliqueSlip, StaysFiniteWhereTheFingerGrazes) {
  TouchBatch touches = TestBatch(1, 1);
  touches.cos_incidence = {0};
  ApplyByName("oblique_slip", {{"travel_mm", {0.5}}}, &touches);
  EXPECT_TRUE(std::isfinite(touches.reported_time_s[0]));
}

}  // namespace
}  // namespace touchstone::effects
