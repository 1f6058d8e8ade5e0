#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(FingerLength, LetsEachFingerTravelItsOwnOffset) {
  TouchBatch touches = TestBatch(2, 3);
  ApplyByName("finger_length", {{"offset_mm", {0.25, 0, -0.25}}}, &touches);
  for (int touch = 0; touch < 2; ++touch) {
    EXPECT_DOUBLE_EQ(touches.travel_offset_m[touches.At(0, touch)], 0.00025);
    EXPECT_DOUBLE_EQ(touches.travel_offset_m[touches.At(1, touch)], 0);
    EXPECT_DOUBLE_EQ(touches.travel_offset_m[touches.At(2, touch)], -0.00025);
  }
}

}  // namespace
}  // namespace touchstone::effects
