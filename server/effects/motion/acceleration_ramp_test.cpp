#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(AccelerationRamp, SetsTheAcceleration) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("acceleration_ramp", {{"acceleration_mm_s2", {250}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.acceleration_m_s2, 0.25);
}

TEST(AccelerationRamp, IsOffAtItsUpperBound) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("acceleration_ramp", {{"acceleration_mm_s2", {1e6}}}, &touches);
  EXPECT_EQ(touches.acceleration_m_s2, 0);
}

}  // namespace
}  // namespace touchstone::effects
