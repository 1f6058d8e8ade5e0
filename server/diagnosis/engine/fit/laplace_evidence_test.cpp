#include "server/diagnosis/engine/fit/laplace_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr int kRows = 400;
constexpr double kNoise = 0.005;
constexpr int kResidual = 0, kActs = 1, kActsNot = 2;  // columns

// 400 rows of noise, a parameter that changes them and one that changes nothing.
class LaplaceEvidenceTest : public ::testing::Test {
 protected:
  LaplaceEvidenceTest() : likelihood({0, kRows}, nullptr, 0, nullptr), columns(kRows, 3) {
    RandomStream random(1, RandomDomain::kTest);
    for (int row = 0; row < kRows; ++row) columns.row(row) << kNoise * random.Normal(), random.Normal(), 0;
  }
  static FreeParameter Parameter(double lower = -1, double upper = 1) {
    FreeParameter parameter;
    parameter.lower = lower;
    parameter.upper = upper;
    parameter.scale = 0.1;
    return parameter;
  }
  LaplaceEvidence Evidence(const std::vector<int>& members, const std::vector<FreeParameter>& parameters) {
    return ComputeLaplaceEvidence(likelihood, Grams(likelihood, likelihood.Prepare(columns)), members,
                                  parameters, Eigen::VectorXd::Zero(static_cast<int>(parameters.size())));
  }

  Likelihood likelihood;
  Eigen::MatrixXd columns;
};

TEST_F(LaplaceEvidenceTest, WithoutParametersIsTheLikelihood) {
  const LaplaceEvidence evidence = Evidence({kResidual}, {});
  const double q = columns.col(kResidual).squaredNorm();
  EXPECT_NEAR(evidence.log_likelihood, likelihood.LogPrior(0) + likelihood.LogLikelihood(q, 0), 1e-9);
  EXPECT_NEAR(evidence.log_evidence, evidence.log_likelihood, 1e-9);
  EXPECT_NEAR(evidence.sigma, std::sqrt(q / kRows), 1e-3 * kNoise);
}

TEST_F(LaplaceEvidenceTest, StepsToTheLeastSquares) {
  columns.col(kResidual) += 0.02 * columns.col(kActs);
  const LaplaceEvidence evidence = Evidence({kResidual, kActs}, {Parameter()});
  const double norm = columns.col(kActs).squaredNorm();
  const double expected = columns.col(kActs).dot(columns.col(kResidual)) / norm;
  EXPECT_NEAR(evidence.step[0], expected, 1e-6);
  EXPECT_NEAR(std::sqrt(evidence.covariance(0, 0)), evidence.sigma / std::sqrt(norm), 1e-6);
}

TEST_F(LaplaceEvidenceTest, GrowsByAnEffectThatIsThereAndFallsByOneThatIsNot) {
  const double without = Evidence({kResidual}, {}).log_evidence;
  const double superfluous = Evidence({kResidual, kActs}, {Parameter()}).log_evidence;
  EXPECT_LT(superfluous, without);
  EXPECT_GT(superfluous, without - std::log(kRows)) << "a parameter costs about half the log of the rows";
  columns.col(kResidual) += 0.02 * columns.col(kActs);
  EXPECT_GT(Evidence({kResidual, kActs}, {Parameter()}).log_evidence,
            Evidence({kResidual}, {}).log_evidence + 100);
}

TEST_F(LaplaceEvidenceTest, IsTheSameWithAParameterThatCannotBeSeen) {
  const LaplaceEvidence evidence = Evidence({kResidual, kActsNot}, {Parameter()});
  EXPECT_NEAR(evidence.log_evidence, Evidence({kResidual}, {}).log_evidence, 1e-6);
  EXPECT_EQ(evidence.step[0], 0);
}

TEST_F(LaplaceEvidenceTest, HoldsAValueAtItsBoundAndTheOthersFitWithIt) {
  columns.col(kActsNot).setLinSpaced(kRows, -1, 1);
  columns.col(kResidual) += -0.02 * columns.col(kActs) + 0.03 * columns.col(kActsNot);
  const LaplaceEvidence evidence = Evidence({kResidual, kActs, kActsNot}, {Parameter(0, 1), Parameter()});
  EXPECT_EQ(evidence.step[0], 0);
  EXPECT_EQ(evidence.covariance(0, 0), 0);
  const double expected =
      columns.col(kActsNot).dot(columns.col(kResidual)) / columns.col(kActsNot).squaredNorm();
  EXPECT_NEAR(evidence.step[1], expected, 1e-6);
}

TEST_F(LaplaceEvidenceTest, DoesNotDependOnTheUnitOfAParameter) {
  columns.col(kResidual) += 0.02 * columns.col(kActs);
  const double in_metres = Evidence({kResidual, kActs}, {Parameter()}).log_evidence;
  columns.col(kActs) /= 1000;
  FreeParameter in_millimetres = Parameter(-1000, 1000);
  in_millimetres.scale = 100;
  EXPECT_NEAR(Evidence({kResidual, kActs}, {in_millimetres}).log_evidence, in_metres, 1e-6);
}

TEST(LogPriorOfValues, FallsWhereAValueLeavesWhatRigsShow) {
  std::vector<FreeParameter> parameters(1);
  parameters[0].scale = 1;
  const double free = LogPriorOfValues(parameters, Eigen::VectorXd::Constant(1, 3.1));
  parameters[0].usual_upper = 3;
  EXPECT_LT(LogPriorOfValues(parameters, Eigen::VectorXd::Constant(1, 3.1)), free - 5);
  EXPECT_GT(LogPriorOfValues(parameters, Eigen::VectorXd::Constant(1, 2.9)), free);
}

TEST(LogPriorOfValues, FallsFromTheValueThatChangesNothing) {
  FreeParameter parameter;
  parameter.neutral = 0.5;
  parameter.scale = 0.1;
  const auto prior = [&](double value) {
    return LogPriorOfValues({parameter}, Eigen::VectorXd::Constant(1, value));
  };
  EXPECT_EQ(prior(0.5), 0);
  EXPECT_LT(prior(0.6), 0);
  EXPECT_NEAR(prior(0.6), prior(0.4), 1e-12);
  EXPECT_NEAR(prior(0.5 + 10 * 0.1), -std::log(2), 1e-12) << "a Cauchy ten times as wide as rigs show";
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
