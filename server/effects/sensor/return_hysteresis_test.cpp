#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ReturnHysteresis, ShortensTravelByAShareOfThePreviousPress) {
  TouchBatch before = TestBatch(1, 3);
  before.previous_press_m = {0.004, 0, 0.001};
  before.time_per_travel_s_m.assign(3, 50);
  TouchBatch after = before;
  ApplyByName("return_hysteresis", {{"fraction", {0.1}}}, &after);
  const double expected_s[] = {-0.02, 0, -0.005};
  for (int finger = 0; finger < 3; ++finger)
    EXPECT_NEAR(after.reported_time_s[finger] - before.reported_time_s[finger], expected_s[finger], 1e-14);
}

}  // namespace
}  // namespace touchstone::effects
