#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(GaussianNoise, GivesEveryFingerTheSameSigma) {
  TouchBatch touches = TestBatch(2, 3);
  ApplyByName("gaussian_noise", {{"sigma_us", {5000}}}, &touches);
  EXPECT_TRUE(touches.any_noise);
  for (const double sigma_s : touches.noise_sigma_s) EXPECT_DOUBLE_EQ(sigma_s, 0.005);
}

TEST(GaussianNoise, AddsInQuadratureToNoiseThatIsThere) {
  TouchBatch touches = TestBatch(2, 3);
  ApplyByName("gaussian_noise", {{"sigma_us", {3000}}}, &touches);
  ApplyByName("gaussian_noise", {{"sigma_us", {4000}}}, &touches);
  for (const double sigma_s : touches.noise_sigma_s) EXPECT_NEAR(sigma_s, 0.005, 1e-15);
}

}  // namespace
}  // namespace touchstone::effects
