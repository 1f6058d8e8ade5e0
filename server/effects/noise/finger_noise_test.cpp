#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(FingerNoise, AddsToItsFingerAlone) {
  TouchBatch touches = TestBatch(2, 3);
  ApplyByName("gaussian_noise", {{"sigma_us", {3000}}}, &touches);
  ApplyByName("finger_noise", {{"sigma_us", {0, 4000, 0}}}, &touches);
  for (int touch = 0; touch < 2; ++touch) {
    EXPECT_NEAR(touches.noise_sigma_s[touches.At(0, touch)], 0.003, 1e-12);
    EXPECT_NEAR(touches.noise_sigma_s[touches.At(1, touch)], 0.005, 1e-12);
    EXPECT_NEAR(touches.noise_sigma_s[touches.At(2, touch)], 0.003, 1e-12);
  }
}

TEST(FingerNoise, IsThereWithoutGaussianNoise) {
  TouchBatch touches = TestBatch(2, 3);
  ApplyByName("finger_noise", {{"sigma_us", {0, 4000, 0}}}, &touches);
  EXPECT_TRUE(touches.any_noise);
  EXPECT_NEAR(touches.noise_sigma_s[touches.At(1, 0)], 0.004, 1e-12);
}

}  // namespace
}  // namespace touchstone::effects
