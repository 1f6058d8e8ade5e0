#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(HeavyTailNoise, SetsTheDegreesOfFreedom) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("heavy_tail_noise", {{"degrees_of_freedom", {3}}}, &touches);
  EXPECT_EQ(touches.degrees_of_freedom, 3);
}

TEST(HeavyTailNoise, IsGaussianAtItsUpperBound) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("heavy_tail_noise", {{"degrees_of_freedom", {1000}}}, &touches);
  EXPECT_EQ(touches.degrees_of_freedom, 0);
}

}  // namespace
}  // namespace touchstone::effects
