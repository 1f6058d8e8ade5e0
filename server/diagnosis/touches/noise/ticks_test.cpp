#include "server/diagnosis/touches/noise/ticks.h"

#include <gtest/gtest.h>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::touches {
namespace {

// Whole microseconds, as files have them; the fingers of `rounded` in whole ticks.
SyntheticSet WithTicks(const std::vector<int>& rounded, double interval_s) {
  SyntheticSet set(3, 40, 2, kSyntheticSigmaS, 4);
  auto read = std::make_shared<session::MeasurementSet>(*set.observations.set);
  for (size_t e = 0; e < read->time_s.size(); ++e) read->time_s[e] = std::round(read->time_s[e] * 1e6) / 1e6;
  for (const int finger : rounded)
    for (int k = 0; k < set.size(); ++k) {
      double& time_s = read->time_s[k * 3 + finger];
      time_s = std::round(time_s / interval_s) * interval_s;
    }
  set.observations.set = read;
  return set;
}

TEST(FingerTicks, AreThoseOfOneFinger) {
  for (const double interval_s : {25e-3, 8e-3, 1e-3}) {
    const FingerTicks found = FindFingerTicks(WithTicks({2}, interval_s).observations);
    EXPECT_EQ(found.finger, 2);
    EXPECT_NEAR(found.interval_s, interval_s, 1e-6);
  }
}

TEST(FingerTicks, AreNotWhatAllFingersShare) {
  EXPECT_EQ(FindFingerTicks(WithTicks({0, 1, 2}, 8e-3).observations).interval_s, 0);
  EXPECT_EQ(FindFingerTicks(WithTicks({}, 1).observations).interval_s, 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::touches
