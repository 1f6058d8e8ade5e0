#include <gtest/gtest.h>
#include <cmath>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(PositionNoise, IsItsLengthOverTheSpeed) {
  TouchBatch touches = TestBatch(2, 1);
  touches.time_per_travel_s_m = {50, 100};  // 20 and 10 mm/s
  ApplyByName("position_noise", {{"sigma_mm", {0.1}}}, &touches);
  EXPECT_TRUE(touches.any_noise);
  EXPECT_NEAR(touches.noise_sigma_s[0], 0.005, 1e-12);
  EXPECT_NEAR(touches.noise_sigma_s[1], 0.010, 1e-12);
}

TEST(PositionNoise, AddsToGaussianNoiseInQuadratureInAnyOrder) {
  TouchBatch before = TestBatch(2, 1);
  before.time_per_travel_s_m = {50, 100};
  TouchBatch after = before;
  ApplyByName("position_noise", {{"sigma_mm", {0.06}}}, &before);
  ApplyByName("gaussian_noise", {{"sigma_us", {4000}}}, &before);
  ApplyByName("gaussian_noise", {{"sigma_us", {4000}}}, &after);
  ApplyByName("position_noise", {{"sigma_mm", {0.06}}}, &after);
  EXPECT_NEAR(before.noise_sigma_s[0], 0.005, 1e-12);
  EXPECT_NEAR(after.noise_sigma_s[0], before.noise_sigma_s[0], 1e-15);
}

}  // namespace
}  // namespace touchstone::effects
