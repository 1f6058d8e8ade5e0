#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(SpeedError, MultipliesTheSpeed) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("speed_error", {{"relative", {0.05}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.speed_factor, 1.05);
}

}  // namespace
}  // namespace touchstone::effects
