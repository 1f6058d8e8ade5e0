#include "server/diagnosis/distributions/two_samples.h"

#include <cmath>

#include <gtest/gtest.h>

namespace touchstone::diagnosis::distributions {
namespace {

TEST(EnergyDistance, IsZeroForEqualSamplesAndTheClosedFormForTwoPoints) {
  const TimePoints a = ToPoints({0, 0, 0}, 3), b = ToPoints({0.003, 0, 0}, 3);
  EXPECT_EQ(EnergyDistance(a, a, 0), 0);
  // |P (3, 0, 0)| = 3 sqrt(2 / 3).
  EXPECT_NEAR(EnergyDistance(a, b, 0), 2 * 0.003 * std::sqrt(2.0 / 3), 1e-12);
}

TEST(EnergyDistance, DoesNotDependOnACommonTimeNorOnIncompleteTouches) {
  const TimePoints a = ToPoints({0, 0.1, 0.3, 0.2, 0.2, 0.5, 0, 0, NAN}, 3);
  const TimePoints b = ToPoints({7, 7.1, 7.3, 2.2, 2.2, 2.5}, 3);
  EXPECT_EQ(a.size(), 2);
  EXPECT_NEAR(EnergyDistance(a, b, MeanDistance(b, b)), 0, 1e-12);
}

TEST(KolmogorovDistance, IsTheLargestGapWithTiesOnBothSides) {
  EXPECT_EQ(KolmogorovDistance({1, 2, 3, 4}, {1, 2, 3, 4}), 0);
  EXPECT_EQ(KolmogorovDistance({1, 1, 1, 2}, {1, 2, 2, 2}), 0.5);
  EXPECT_EQ(KolmogorovDistance({1, 2}, {3, 4}), 1);
}

}  // namespace
}  // namespace touchstone::diagnosis::distributions
