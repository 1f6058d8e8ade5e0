#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(CorrelatedNoise, TellsTheStageItsSizeAndItsMemory) {
  TouchBatch before = TestBatch(3, 3), after = before;
  ApplyByName("correlated_noise", {{"sigma_us", {7000}}, {"time_s", {300}}}, &after);
  EXPECT_DOUBLE_EQ(after.wander_sigma_s, 0.007);
  EXPECT_DOUBLE_EQ(after.wander_time_s, 300);
  EXPECT_THAT(ChangedFields(before, after), testing::ElementsAre("wander_sigma_s", "wander_time_s"));
}

}  // namespace
}  // namespace touchstone::effects
