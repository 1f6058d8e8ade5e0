#include "server/diagnosis/selection/session/time_structure.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::selection {
namespace {

// 4 rounds of 60 poses, noise of sigma 1, and a course of the session on the first finger.
struct Repeats {
  touches::Observations o;
  std::vector<double> residuals;

  Repeats(uint64_t seed, double (*course)(int k)) {
    o.fingers = 3;
    RandomStream random(seed, RandomDomain::kTest);
    for (int k = 0; k < 240; ++k) {
      o.row.push_back(k);
      o.pose.push_back(k % 60);
      o.used.push_back(1);
      o.previous.push_back(k - 1);
      double r[3], mean = 0;
      for (int i = 0; i < 3; ++i) r[i] = random.Normal() + (i == 0 ? course(k) : 0);
      for (const double value : r) mean += value / 3;
      for (const double value : r) residuals.push_back(value - mean);
    }
    o.poses = 60;
  }
};

TEST(TimeStructure, StaysBelowFourWithoutACourse) {
  double max = 0, sum = 0;
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const Repeats repeats(seed, [](int) { return 0.0; });
    const TimeStructure found = FindTimeStructure(repeats.o, repeats.residuals);
    max = std::max(max, found.z);
    sum += found.z;
    EXPECT_NEAR(found.sigma_s, 1, 0.15);
  }
  EXPECT_LT(max, 3.5);
  EXPECT_NEAR(sum / 50, 0, 0.5);
}

TEST(TimeStructure, SeesAWaveAndMeasuresTheNoiseBelowIt) {
  const Repeats repeats(1, [](int k) { return 3 * std::sin(k / 20.0); });
  const TimeStructure found = FindTimeStructure(repeats.o, repeats.residuals);
  EXPECT_GT(found.z, 6);
  EXPECT_LT(found.p, 1e-8);
  EXPECT_NEAR(found.sigma_s, 1, 0.15);
  EXPECT_GT(found.finger_z[0], found.finger_z[1]);
}

TEST(TimeStructure, NeedsRepeats) {
  Repeats repeats(1, [](int) { return 0.0; });
  for (int k = 0; k < 240; ++k) repeats.o.pose[k] = k;
  repeats.o.poses = 240;
  const TimeStructure found = FindTimeStructure(repeats.o, repeats.residuals);
  EXPECT_EQ(found.z, 0);
  EXPECT_EQ(found.p, 1);
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
