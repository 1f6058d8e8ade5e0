#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(TipRadius, SetsTheBallBeforeTheCast) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("tip_radius", {{"radius_mm", {1.5}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.tip_radius_m, 0.0015);
}

}  // namespace
}  // namespace touchstone::effects
