#include "server/diagnosis/engine/nothing_missing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr int kReadings = 60, kDraws = 100;

Eigen::MatrixXd Normal(int rows, int columns, uint64_t index) {
  RandomStream random(7, RandomDomain::kDiagnosis, index);
  Eigen::MatrixXd values(rows, columns);
  for (int j = 0; j < columns; ++j)
    for (int i = 0; i < rows; ++i) values(i, j) = random.Normal();
  return values;
}

// Twelve effects that look alike, a curve of five hats, and an effect on the last third of the rows.
LinearHypotheses Hypotheses() {
  LinearHypotheses hypotheses;
  const Eigen::MatrixXd columns = Normal(kReadings, 12, 1), shared = Normal(kReadings, 1, 2);
  for (int j = 0; j < columns.cols(); ++j) hypotheses.Add(columns.col(j) + 2 * shared);
  hypotheses.Add(Normal(kReadings, 5, 3));
  hypotheses.Add(Normal(kReadings / 3, 2, 4), 2 * kReadings / 3);
  return hypotheses;
}

NothingMissing Assess(const LinearHypotheses& hypotheses, const Eigen::VectorXd& data, uint64_t index) {
  Eigen::MatrixXd residuals(kReadings, kDraws + 1);
  residuals.col(0) = data;
  residuals.rightCols(kDraws) = Normal(kReadings, kDraws, index);
  return WorstOfAll(hypotheses.PValues(residuals));
}

// Kolmogorov's D of 500 values is below 0.073 in 99 of 100 cases.
TEST(NothingMissing, IsUniformWhereNothingIs) {
  const LinearHypotheses hypotheses = Hypotheses();
  std::vector<double> p;
  constexpr int kSets = 500;
  for (int set = 0; set < kSets; ++set)
    // The size of the noise does not matter.
    p.push_back(Assess(hypotheses, 3 * Normal(kReadings, 1, 1000 + 2 * set), 1001 + 2 * set).p);
  std::sort(p.begin(), p.end());
  double distance = 0;
  for (int i = 0; i < kSets; ++i)
    distance =
        std::max({distance, std::abs(p[i] - i / double{kSets}), std::abs(p[i] - (i + 1) / double{kSets})});
  EXPECT_LT(distance, 0.073);
}

TEST(NothingMissing, IsSmallWhereOneEffectIs) {
  const LinearHypotheses hypotheses = Hypotheses();
  const Eigen::VectorXd noise = Normal(kReadings, 1, 90);
  const Eigen::VectorXd effect = Normal(kReadings, 12, 1).col(3) + 2 * Normal(kReadings, 1, 2);
  EXPECT_LT(Assess(hypotheses, noise + 3 * effect, 91).p, 1e-6);
  EXPECT_EQ(Assess(hypotheses, noise, 92).hypotheses, 14);
}

// One row in sixty is explained exactly by chance hardly ever; p of F(1, 59) at t = 3 is 0.0039.
TEST(NothingMissing, HasTheTailOfFishersRatio) {
  LinearHypotheses one;
  one.Add(Eigen::MatrixXd::Identity(kReadings, 1) * 1e-9);
  Eigen::MatrixXd residuals = Eigen::MatrixXd::Ones(kReadings, 1);
  residuals(0, 0) = 3;
  EXPECT_NEAR(one.PValues(residuals)(0, 0), 0.00394, 0.00005);
}

TEST(NothingMissing, TriesNoColumnsThatSayNothing) {
  LinearHypotheses none;
  none.Add(Eigen::MatrixXd::Zero(kReadings, 2));
  none.Add(Eigen::MatrixXd::Constant(kReadings, 1, NAN));
  EXPECT_EQ(none.size(), 0);
  EXPECT_EQ(WorstOfAll(none.PValues(Normal(kReadings, 5, 9))).p, 1);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
