#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ChannelLatency, DelaysEachFingersReport) {
  const TouchBatch before = TestBatch(2, 3);
  TouchBatch after = before;
  ApplyByName("channel_latency", {{"latency_us", {3000, -1000, -2000}}}, &after);
  const double latency_s[] = {0.003, -0.001, -0.002};
  for (int finger = 0; finger < 3; ++finger)
    for (int touch = 0; touch < 2; ++touch)
      EXPECT_DOUBLE_EQ(after.reported_time_s[after.At(finger, touch)],
                       before.reported_time_s[before.At(finger, touch)] + latency_s[finger]);
}

}  // namespace
}  // namespace touchstone::effects
