#include "server/diagnosis/touches/contrasts.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::touches {
namespace {

TEST(Contrasts, AreBlindToAShiftOfAWholeTouch) {
  SyntheticSet set(2, 6, 2, 0.005, 1);
  const Contrasts contrasts(set.observations, set.prediction.time_s);
  std::vector<double> times = set.observations.time_s;
  const Eigen::VectorXd before = contrasts.Apply(times);
  for (size_t e = 0; e < times.size(); ++e) times[e] += 0.3 * static_cast<double>(e / 3);
  EXPECT_LT((contrasts.Apply(times) - before).norm(), 1e-9);
}

TEST(Contrasts, KeepTheLengthOfAResidual) {
  SyntheticSet set(2, 6, 2, 0.005, 1);
  const Contrasts contrasts(set.observations, set.prediction.time_s);
  double squares = 0;
  for (const double r : set.residuals) squares += r * r;
  EXPECT_NEAR(contrasts.Apply(set.residuals).squaredNorm(), squares, 1e-12 * squares);
}

TEST(Contrasts, LeaveOutFingersThatDidNotReport) {
  SyntheticSet set(1, 4, 1, 0.005, 1);
  set.observations.time_s[0] = NAN;                               // touch 0: two fingers left
  set.observations.time_s[3] = set.observations.time_s[4] = NAN;  // touch 1: one
  const Contrasts contrasts(set.observations, set.prediction.time_s);
  EXPECT_EQ(contrasts.rows(), 1 + 0 + 2 + 2);
  EXPECT_EQ(contrasts.touches(), (std::vector<int>{0, 2, 3}));
  EXPECT_FALSE(contrasts.TakesPart(0, 0));
  // Two fingers: their difference over the square root of two.
  const double difference = set.observations.time_s[2] - set.observations.time_s[1];
  EXPECT_NEAR(contrasts.Apply(set.observations.time_s)[0], difference / std::sqrt(2.0), 1e-12);
}

TEST(Contrasts, StandSortedByObject) {
  SyntheticSet set(3, 5, 2, 0.005, 1);
  const Contrasts contrasts(set.observations, set.prediction.time_s);
  for (int row = 1; row < contrasts.rows(); ++row)
    EXPECT_LE(contrasts.object_of_row()[row - 1], contrasts.object_of_row()[row]);
  EXPECT_EQ(contrasts.FirstRowOfObject(3), contrasts.rows());
}

}  // namespace
}  // namespace touchstone::diagnosis::touches
