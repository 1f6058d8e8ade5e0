#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(PollInterval, SetsTheTick) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("poll_interval", {{"interval_us", {500}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.poll_interval_s, 500e-6);
}

}  // namespace
}  // namespace touchstone::effects
