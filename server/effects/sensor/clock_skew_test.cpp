#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ClockSkew, MultipliesReportedTimes) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("clock_skew", {{"relative", {-0.002}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.clock_factor, 0.998);
}

}  // namespace
}  // namespace touchstone::effects
