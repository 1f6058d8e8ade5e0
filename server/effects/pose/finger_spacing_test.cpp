#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(FingerSpacing, AddsToTheDistanceBetweenNeighbours) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("finger_spacing", {{"delta_mm", {-0.5}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.spacing_m, 0.0295);
}

}  // namespace
}  // namespace touchstone::effects
