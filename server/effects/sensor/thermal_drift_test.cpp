#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ThermalDrift, AddsRateTimesSessionTimeAsTravel) {
  TouchBatch before = TestBatch(2, 3);
  before.session_time_s = {0, 1800};
  before.time_per_travel_s_m.assign(6, 50);
  TouchBatch after = before;
  ApplyByName("thermal_drift", {{"rate_mm_per_h", {1, 0, -1}}}, &after);
  for (int finger = 0; finger < 3; ++finger) {
    EXPECT_EQ(after.reported_time_s[after.At(finger, 0)], before.reported_time_s[before.At(finger, 0)]);
    // Half a millimetre after half an hour, 25 ms at 20 mm/s.
    EXPECT_NEAR(after.reported_time_s[after.At(finger, 1)] - before.reported_time_s[before.At(finger, 1)],
                (1 - finger) * 0.025, 1e-12);
  }
}

}  // namespace
}  // namespace touchstone::effects
