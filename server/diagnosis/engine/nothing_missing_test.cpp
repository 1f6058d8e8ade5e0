#include "server/diagnosis/engine/nothing_missing.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/diagnosis/engine/uniform_p_values.h"

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

TEST(NothingMissing, IsUniformWhereNothingIs) {
  const LinearHypotheses hypotheses = Hypotheses();
  std::vector<double> p;
  for (int set = 0; set < 500; ++set)
    // The size of the noise does not matter.
    p.push_back(Assess(hypotheses, 3 * Normal(kReadings, 1, 1000 + 2 * set), 1001 + 2 * set).p);
  ExpectUniform(p);
}

// Two kinds with the same rows that draw from the same seed are the hardest case: their draws are equal.
TEST(NothingMissing, IsUniformOverTheHypothesesOfSeveralKinds) {
  TOUCHSTONE_SECOND_TIER("statistical: 500 sets of two kinds");
  const LinearHypotheses hypotheses = Hypotheses();
  const LinearTestModel rows(1, kReadings, 1);
  std::vector<double> p;
  for (uint64_t set = 0; set < 500; ++set) {
    const auto tried = [&](int kind) {
      return hypotheses.PValues(DataAndNoise(rows, rows.Random(2 * set + kind, 1 + kind), set, kDraws));
    };
    const TriedPValues first = tried(0), second = tried(1);
    p.push_back(WorstOfKinds({&first, &second})->p);
  }
  ExpectUniform(p);
}

TEST(NothingMissing, OfSeveralKindsIsThatOfTheWorst) {
  const TriedPValues agreeing = AgreeingPValues(7), impossible = ImpossiblePValues(3);
  EXPECT_EQ(WorstOfKinds({&agreeing})->p, 1);
  EXPECT_EQ(WorstOfKinds({&agreeing, &impossible})->p, 0);
  EXPECT_EQ(WorstOfKinds({&agreeing, &impossible})->hypotheses, 10);
}

TEST(NothingMissing, IsNotSaidWhereAKindCannotSay) {
  const TriedPValues agreeing = AgreeingPValues(7), none;
  EXPECT_FALSE(WorstOfKinds({&agreeing, &none}));
  EXPECT_FALSE(WorstOfKinds(std::vector<const TriedPValues*>()));
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

// Kind: what a test takes for independent that is not. Corners of one picture are off together.
TEST(NothingMissing, IsNotSmallWhereClustersShareTheirErrors) {
  constexpr int kClusters = 12, kRows = 50;
  std::vector<int> first;
  for (int c = 0; c <= kClusters; ++c) first.push_back(c * kRows);
  const Eigen::MatrixXd columns = Normal(kClusters * kRows, 3, 50);
  LinearHypotheses together(0, first), apart;
  for (int j = 0; j < columns.cols(); ++j) together.Add(columns.col(j)), apart.Add(columns.col(j));
  int small = 0, small_apart = 0;
  for (int set = 0; set < 40; ++set) {
    Eigen::MatrixXd residuals = Normal(kClusters * kRows, kDraws + 1, 60 + 2 * set);
    const Eigen::MatrixXd shared = Normal(kClusters, 3, 61 + 2 * set);
    for (int c = 0; c < kClusters; ++c)
      residuals.col(0).segment(first[c], kRows) +=
          columns.middleRows(first[c], kRows) * shared.row(c).transpose();
    small += WorstOfAll(together.PValues(residuals)).p < 0.02;
    small_apart += WorstOfAll(apart.PValues(residuals)).p < 0.02;
  }
  EXPECT_LE(small, 4);
  EXPECT_GE(small_apart, 20);
}

// Whatever rows of a cluster share, and of whatever size.
TEST(NothingMissing, IsUniformWhereSignsOfClustersAreTurned) {
  constexpr int kClusters = 24, kRows = 20;
  std::vector<int> first;
  for (int c = 0; c <= kClusters; ++c) first.push_back(c * kRows);
  const Eigen::MatrixXd columns = Normal(kClusters * kRows, 6, 150);
  LinearHypotheses hypotheses(0, first);
  for (int j = 0; j < columns.cols(); ++j) hypotheses.Add(columns.col(j));
  std::vector<double> p;
  for (int set = 0; set < 300; ++set) {
    Eigen::VectorXd residual = Normal(kClusters * kRows, 1, 160 + 2 * set);
    const Eigen::MatrixXd shared = Normal(kClusters, 6, 161 + 2 * set);
    for (int c = 0; c < kClusters; ++c)
      residual.segment(first[c], kRows) +=
          (1 + c % 3) * columns.middleRows(first[c], kRows) * shared.row(c).transpose();
    p.push_back(WorstOfAll(hypotheses.PValues(DataAndTurned(residual, first, set, kDraws))).p);
  }
  ExpectUniform(p);
}

TEST(NothingMissing, IsAsSmallAsWhatAnUnexplainedRestRestsOn) {
  const NothingMissing alone{0.6, 36};
  UnexplainedRest rest;
  EXPECT_EQ(WithRest(alone, rest).p, 0.6);
  EXPECT_EQ(WithRest(alone, rest).hypotheses, 36);
  rest.covariates = {{"row", 0.04, 3}, {"session_time_s", 1e-6, 12}};
  EXPECT_NEAR(WithRest(alone, rest).p, 37e-6, 1e-9);
  EXPECT_EQ(WithRest(alone, rest).hypotheses, 37);
  EXPECT_NEAR(WithRest(alone, rest, 1e-9).p, 37e-9, 1e-12);
  // One that says nothing is paid for all the same.
  EXPECT_NEAR(WithFurther(alone, 0.9).p, 0.6 * 37 / 36, 1e-9);
  EXPECT_EQ(WithFurther({1, 0}, 0.02).p, 0.02);
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
