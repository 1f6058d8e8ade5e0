#include "server/diagnosis/selection/quality.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

TEST(Rmse, EqualsSigmaWhereTheModelIsPerfect) {
  const touches::SyntheticSet set(5, 48, 4, 0.005, 1);
  EXPECT_NEAR(touches::Rmse(set.observations, set.residuals), 0.005, 0.0002);
}

TEST(PureError, IsTheScatterOfRepeatsWhateverTheMisfit) {
  touches::SyntheticSet set(5, 48, 4, 0.005, 2);
  for (int k = 0; k < set.size(); ++k)
    set.observations.time_s[k * 3] += 0.05 * std::sin(set.observations.pose[k]);
  set.Finish();
  const touches::SumOfSquares error = PureErrorOf(set.observations, set.residuals);
  EXPECT_EQ(error.degrees_of_freedom, 5 * 48 * (4 - 1) * 2);
  EXPECT_NEAR(std::sqrt(error.sum_of_squares / error.degrees_of_freedom), 0.005, 0.0003);
  EXPECT_GT(touches::Rmse(set.observations, set.residuals), 0.015);
}

TEST(LackOfFit, IsUniformWhereNothingIsMissing) {
  int below_tenth = 0;
  constexpr int kSets = 200;
  for (int seed = 0; seed < kSets; ++seed) {
    const touches::SyntheticSet set(3, 10, 3, 0.005, 100 + seed);
    below_tenth += LackOfFitP(set.observations, set.residuals, 0) < 0.1;
  }
  EXPECT_NEAR(below_tenth, 0.1 * kSets, 4 * std::sqrt(0.09 * kSets));
}

TEST(LackOfFit, SeesAMisfitOfTheSizeOfTheNoise) {
  touches::SyntheticSet set(5, 48, 4, 0.005, 3);
  for (int k = 0; k < set.size(); ++k)
    set.observations.time_s[k * 3] += 0.005 * std::sin(set.observations.pose[k]);
  set.Finish();
  EXPECT_LT(LackOfFitP(set.observations, set.residuals, 0), 1e-6);
}

TEST(NoiseFloor, IsAnUpperBoundWithoutRepeats) {
  const touches::SyntheticSet set(5, 48, 1, 0.005, 4);
  const engine::NoiseFloor floor = NoiseFloorOf(set.observations, set.residuals, 3);
  EXPECT_FALSE(floor.from_repeats);
  EXPECT_NEAR(floor.sigma, 5000e-6, 400e-6);
  EXPECT_LT(floor.lower, floor.sigma);
  EXPECT_GT(floor.upper, floor.sigma);
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
