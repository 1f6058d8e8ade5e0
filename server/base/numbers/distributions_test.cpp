#include "server/base/numbers/distributions.h"

#include <gtest/gtest.h>

#include <cmath>

namespace touchstone {
namespace {

TEST(ChiSquaredTail, OfTwoDegreesOfFreedomIsExponential) {
  for (const double x : {0.0, 0.3, 2.0, 30.0}) EXPECT_NEAR(ChiSquaredTail(x, 2), std::exp(-0.5 * x), 1e-15);
}

TEST(ChiSquaredTail, IsOneWhereNothingWasGained) {
  EXPECT_EQ(ChiSquaredTail(-1, 3), 1);
  EXPECT_EQ(ChiSquaredTail(5, 0), 1);
}

TEST(ChiSquaredQuantile, IsTheInverseOfTheTail) {
  for (const double p : {0.025, 0.5, 0.975})
    EXPECT_NEAR(ChiSquaredTail(ChiSquaredQuantile(p, 7.5), 7.5), 1 - p, 1e-12);
}

TEST(NoncentralChiSquaredTail, OfOneDegreeOfFreedomIsTwoTailsOfAShiftedNormal) {
  const auto above = [](double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); };
  EXPECT_NEAR(NoncentralChiSquaredTail(9, 1, 4), above(3 - 2) + above(3 + 2), 1e-12);
  EXPECT_EQ(NoncentralChiSquaredTail(9, 2, 0), ChiSquaredTail(9, 2));
}

TEST(NoncentralityForTail, IsTheInverseOfTheTail) {
  for (const double values : {1.0, 3.0})
    EXPECT_NEAR(NoncentralChiSquaredTail(17, values, NoncentralityForTail(17, values, 0.8)), 0.8, 1e-9);
  EXPECT_EQ(NoncentralityForTail(0.01, 3, 0.8), 0);
}

TEST(StudentTail, OfOneDegreeOfFreedomIsCauchys) {
  for (const double t : {-2.0, 0.0, 1.0, 5.0})
    EXPECT_NEAR(StudentTail(t, 1), 0.5 - std::atan(t) / M_PI, 1e-14);
}

TEST(StudentQuantile, IsTheInverseOfTheTail) {
  EXPECT_NEAR(StudentTail(StudentQuantile(0.975, 9), 9), 0.025, 1e-13);
}

TEST(FisherTail, OfOneNumeratorIsTwoTailsOfStudent) {
  EXPECT_NEAR(FisherTail(2.5 * 2.5, 1, 11), 2 * StudentTail(2.5, 11), 1e-13);
}

TEST(GammaTail, OfMeanAndTwiceTheMeanIsChiSquareds) {
  EXPECT_NEAR(GammaTail(4.2, 6, 12), ChiSquaredTail(4.2, 6), 1e-14);
}

TEST(BetaQuantile, OfAnEvenDistributionIsTheProbability) {
  EXPECT_NEAR(BetaQuantile(0.3, 1, 1), 0.3, 1e-13);
}

}  // namespace
}  // namespace touchstone
