#include <gtest/gtest.h>
#include <cmath>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(IncidenceNoise, GrowsSigmaByOnePlusSlopeTimesTangent) {
  TouchBatch touches = TestBatch(2, 1);
  touches.cos_incidence = {1, std::cos(60 * kRadiansPerDegree)};
  ApplyByName("incidence_noise", {{"slope", {2}}}, &touches);
  ASSERT_EQ(touches.noise_growth.size(), 2u);
  EXPECT_NEAR(touches.noise_growth[0], 1, 1e-12);
  EXPECT_NEAR(touches.noise_growth[1], 1 + 2 * std::sqrt(3.0), 1e-12);
}

TEST(IncidenceNoise, ActsWhereverItStandsInTheStack) {
  TouchBatch before = TestBatch(5, 3);
  TouchBatch after = before;
  ApplyByName("incidence_noise", {{"slope", {2}}}, &before);
  ApplyByName("gaussian_noise", {{"sigma_us", {5000}}}, &before);
  ApplyByName("gaussian_noise", {{"sigma_us", {5000}}}, &after);
  ApplyByName("incidence_noise", {{"slope", {2}}}, &after);
  EXPECT_TRUE(ChangedFields(before, after).empty());
}

}  // namespace
}  // namespace touchstone::effects
