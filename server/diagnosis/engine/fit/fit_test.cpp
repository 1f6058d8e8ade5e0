#include "server/diagnosis/engine/fit/fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kSigma = 0.005;   // of the rows
constexpr double kColumn = 50;     // size of a column, per m or rad
constexpr double kPushM = 0.8e-3;  // within the bounds of object_push, 0 to 50 mm

class FitTest : public ::testing::Test {
 protected:
  FitTest() : rows(4, 25, 2) {
    rows.columns["object_push"] = rows.Random(1, kColumn);
    rows.columns["tool_tilt"] = rows.Random(2, kColumn);
    rows.measured = rows.Random(3, kSigma);
    likelihood = std::make_unique<Likelihood>(rows.GroupRows(), nullptr, 0, nullptr);
    experiment.observations = &rows;
    experiment.likelihood = likelihood.get();
  }
  Parameterization Free(const std::vector<std::string>& effects, bool per_object = false) const {
    Parameterization model(model::NominalModel(), rows.groups());
    for (const std::string& effect : effects) model.Add(effects::Catalogue().Find(effect), per_object);
    return model;
  }
  LinearTestModel rows;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
};

TEST_F(FitTest, FindsTheLeastSquaresOfALinearModel) {
  rows.measured += kPushM * rows.columns["object_push"];
  const Fit fit = *FitModel(experiment, Free({"object_push", "tool_tilt"}));
  Eigen::MatrixXd j(rows.rows(), 2);
  j << rows.columns["object_push"], rows.columns["tool_tilt"];
  const Eigen::MatrixXd information = j.transpose() * j;
  const Eigen::VectorXd expected = information.ldlt().solve(j.transpose() * rows.measured);
  const double sigma = (rows.measured - j * expected).norm() / std::sqrt(rows.rows() - 2);
  EXPECT_NEAR(fit.sigma, sigma, 1e-4 * sigma);
  for (int i = 0; i < 2; ++i) {
    const double error = sigma * std::sqrt(information.inverse()(i, i));
    EXPECT_NEAR(fit.point[i], expected[i], 0.01 * error);
    EXPECT_NEAR(std::sqrt(fit.covariance(i, i)), error, 0.01 * error);
  }
}

TEST_F(FitTest, HoldsAValueAtItsBound) {
  rows.measured -= kPushM * rows.columns["object_push"];  // a push cannot be negative
  const Fit fit = *FitModel(experiment, Free({"object_push"}));
  EXPECT_EQ(fit.point[0], 0);
  EXPECT_EQ(fit.covariance(0, 0), 0);
}

TEST_F(FitTest, FollowsAResponseThatIsNotLinear) {
  rows.bend = 500;  // at 0.8 mm the response is 1.4 times the linear one
  rows.measured += rows.columns["object_push"] * (kPushM + rows.bend * kPushM * kPushM);
  const Fit fit = *FitModel(experiment, Free({"object_push"}));
  EXPECT_NEAR(fit.point[0], kPushM, 4 * std::sqrt(fit.covariance(0, 0)));
  EXPECT_LT(std::sqrt(fit.covariance(0, 0)), 0.02 * kPushM);
}

TEST_F(FitTest, GivesEveryGroupItsOwnValue) {
  for (int row = 0; row < rows.rows(); ++row)
    rows.measured[row] += rows.columns["object_push"][row] * 0.5e-3 * (1 + rows.GroupOfRow(row));
  const Fit fit = *FitModel(experiment, Free({"object_push"}, true));
  ASSERT_EQ(fit.point.size(), 4);
  for (int g = 0; g < 4; ++g)
    EXPECT_NEAR(fit.point[g], 0.5e-3 * (1 + g), 4 * std::sqrt(fit.covariance(g, g))) << g;
}

TEST_F(FitTest, DerivativesAreTheColumnsOfALinearModel) {
  const Parameterization model = Free({"object_push", "tool_tilt"});
  const auto predicted = rows.Predict(model.At(model.Start()));
  const Eigen::MatrixXd columns = *Derivatives(experiment, model, model.Start(), *predicted, 1);
  ASSERT_EQ(columns.cols(), 1);
  EXPECT_LT((columns.col(0) - rows.columns["tool_tilt"]).norm(), 1e-9 * columns.norm());
}

TEST_F(FitTest, EndsWhenItIsCancelled) {
  experiment.cancelled = [] { return true; };
  EXPECT_EQ(FitModel(experiment, Free({"object_push"})).status().code(), absl::StatusCode::kCancelled);
}

TEST_F(FitTest, EvidenceGrowsWithACauseAndFallsWithASuperfluousOne) {
  rows.measured += kPushM * rows.columns["object_push"];
  const double none = FitModel(experiment, Free({}))->log_evidence;
  const double push = FitModel(experiment, Free({"object_push"}))->log_evidence;
  const double both = FitModel(experiment, Free({"object_push", "tool_tilt"}))->log_evidence;
  EXPECT_GT(push, none + 50);
  EXPECT_LT(both, push);
  // What the second costs is about half the log of the number of rows, less what it happens to follow.
  EXPECT_GT(both, push - std::log(rows.rows()));
}

TEST_F(FitTest, EvidenceOfAnEffectThatTheRowsCannotSeeIsUnchanged) {
  rows.columns["tool_tilt"].setZero();
  const double none = FitModel(experiment, Free({}))->log_evidence;
  EXPECT_NEAR(FitModel(experiment, Free({"tool_tilt"}))->log_evidence, none, 1e-6);
}

TEST_F(FitTest, LikelihoodIsTheGaussianWithTheBestSigma) {
  const Fit fit = *FitModel(experiment, Free({}));
  const double n = rows.rows();
  EXPECT_NEAR(fit.log_likelihood, -0.5 * n * std::log(rows.measured.squaredNorm() / n), 1e-9 * n);
}

TEST_F(FitTest, HeldOutErrorIsAboveTheErrorByTheValuesThatWereFitted) {
  const Fit fit = *FitModel(experiment, Free({"object_push", "tool_tilt"}, true));  // 8 values of noise
  const double rmse = std::sqrt(fit.columns.values.col(0).squaredNorm() / rows.rows());
  EXPECT_GT(HeldOutRmse(experiment, fit), rmse);
  EXPECT_LT(HeldOutRmse(experiment, fit), 1.2 * rmse);
}

TEST_F(FitTest, HeldOutErrorOfNothingFittedIsTheError) {
  const Fit fit = *FitModel(experiment, Free({}));
  EXPECT_DOUBLE_EQ(HeldOutRmse(experiment, fit), std::sqrt(rows.measured.squaredNorm() / rows.rows()));
}

// An effect of one group only: groups that are left out do not follow the others.
TEST_F(FitTest, HeldOutErrorSeesThatGroupsDisagree) {
  for (int row = 0; row < rows.rows(); ++row)
    if (rows.GroupOfRow(row) == 0) rows.measured[row] += 4 * kPushM * rows.columns["object_push"][row];
  const Fit together = *FitModel(experiment, Free({"object_push"}));
  const Fit apart = *FitModel(experiment, Free({"object_push"}, true));
  EXPECT_LT(HeldOutRmse(experiment, apart), 1.25 * kSigma);
  EXPECT_GT(HeldOutRmse(experiment, together), 5 * kSigma);
}

TEST_F(FitTest, RefittedHeldOutErrorOfAnEffectThatHoldsEverywhereIsTheNoise) {
  rows.measured += kPushM * rows.columns["object_push"];
  const Fit fit = *FitModel(experiment, Free({"object_push"}));
  const double heldout = *HeldOutRmseRefitted(experiment, fit);
  EXPECT_GT(heldout, std::sqrt(fit.columns.values.col(0).squaredNorm() / rows.rows()));
  EXPECT_LT(heldout, 1.1 * kSigma);
}

// The effect begins in the last fifth of the session: places that are left out follow the others, that time does not.
TEST_F(FitTest, RefittedHeldOutErrorSeesThatTimesDisagree) {
  rows.columns["tool_tilt"].setZero();
  for (int row = rows.rows() * 4 / 5; row < rows.rows(); ++row) rows.columns["tool_tilt"][row] = kColumn;
  for (int row = 0; row < rows.rows(); ++row) rows.measured[row] += kPushM * rows.columns["tool_tilt"][row];
  const Fit fit = *FitModel(experiment, Free({"tool_tilt"}));
  EXPECT_GT(*HeldOutRmseRefitted(experiment, fit), 2 * kSigma);
}

// Each group has a stretch of time to itself: left out whole, nothing would be known of its values.
TEST_F(FitTest, RefittedHeldOutErrorOfOwnValuesLeavesOutPartsOfEachGroup) {
  for (int row = 0; row < rows.rows(); ++row)
    rows.measured[row] += rows.columns["object_push"][row] * kPushM * (1 + rows.GroupOfRow(row));
  const Fit fit = *FitModel(experiment, Free({"object_push"}, true));
  EXPECT_LT(*HeldOutRmseRefitted(experiment, fit), 1.2 * kSigma);
}

class ThreeRowsAtATime : public LinearTestModel {
 public:
  using LinearTestModel::LinearTestModel;
  double TimeOfRow(int row) const override { return row / 3; }
};

// Half of a photograph that was seen tells of the other half.
TEST_F(FitTest, RefitsWithoutAStretchOfTimeSeeNothingOfItsTouches) {
  ThreeRowsAtATime three(4, 25, 2);
  three.columns = rows.columns;
  three.measured = rows.measured;
  experiment.observations = &three;
  const Fit fit = *FitModel(experiment, Free({"object_push"}));
  const auto divisions = *RefitWithoutParts(experiment, fit);
  ASSERT_EQ(divisions.size(), 3u);  // groups, places, times
  for (const auto& refits : divisions) {
    std::set<int> left_out;
    for (const RefitWithoutPart& refit : refits)
      for (const int row : refit.rows) EXPECT_TRUE(left_out.insert(row).second) << row;
    EXPECT_EQ(static_cast<int>(left_out.size()), three.rows());
  }
  for (const RefitWithoutPart& refit : divisions[2]) {
    const std::set<int> part(refit.rows.begin(), refit.rows.end());
    for (const int row : part)
      for (int other = row / 3 * 3; other < std::min(row / 3 * 3 + 3, three.rows()); ++other)
        EXPECT_EQ(part.count(other), 1u) << row << " without " << other;
  }
}

// Derivatives that are wrong by their sign, and a count of simulations.
class WrongDerivatives : public LinearTestModel {
 public:
  using LinearTestModel::LinearTestModel;
  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override {
    ++predictions;
    return LinearTestModel::Predict(model);
  }
  absl::StatusOr<std::vector<double>> PredictNear(const model::Model& moved, const model::Model&,
                                                  const std::vector<double>& predicted) const override {
    std::vector<double> near = *LinearTestModel::Predict(moved);
    for (size_t r = 0; r < near.size(); ++r) near[r] = 2 * predicted[r] - near[r];
    return near;
  }
  bool HasRoughDerivatives(const model::Effect&) const override { return rough; }
  bool rough = false;
  mutable int predictions = 0;
};

TEST_F(FitTest, DoesNotHalveAStepOnAlongRoughDerivativesThatLeadUphill) {
  WrongDerivatives wrong(4, 25, 2);
  wrong.columns = rows.columns;
  wrong.measured = rows.measured + 3e-5 * rows.columns["tool_tilt"];
  experiment.observations = &wrong;
  const Fit halved = *FitModel(experiment, Free({"tool_tilt"}));
  EXPECT_EQ(wrong.predictions, 1 + 6);  // where it starts, a step and five halvings
  wrong.rough = true, wrong.predictions = 0;
  const Fit ended = *FitModel(experiment, Free({"tool_tilt"}));
  EXPECT_EQ(wrong.predictions, 1 + 2);
  EXPECT_EQ(ended.point, halved.point);
}

// Reads nothing of the rows that are left out.
class LeavesUnreadOut : public LinearTestModel {
 public:
  using LinearTestModel::LinearTestModel;
  absl::StatusOr<std::vector<double>> PredictOthers(const model::Model& model,
                                                    const std::vector<int>& unread) const override {
    std::vector<double> predicted = *LinearTestModel::Predict(model);
    for (const int row : unread) predicted[row] = 1e6;
    return predicted;
  }
  absl::StatusOr<std::vector<double>> CompletePrediction(const model::Model& model,
                                                         const std::vector<double>&) const override {
    return LinearTestModel::Predict(model);
  }
};

TEST_F(FitTest, HeldOutErrorsDoNotDependOnWhatAFitPredictsOfRowsThatItDoesNotRead) {
  rows.measured += kPushM * rows.columns["object_push"];
  const Fit fit = *FitModel(experiment, Free({"object_push"}));
  const double unseen = *HeldOutRmseRefitted(experiment, fit);
  const std::vector<double> squares = *HeldOutSquaresRefitted(experiment, fit);
  LeavesUnreadOut other(4, 25, 2);
  other.columns = rows.columns;
  other.measured = rows.measured;
  experiment.observations = &other;
  EXPECT_EQ(*HeldOutRmseRefitted(experiment, fit), unseen);
  EXPECT_EQ(*HeldOutSquaresRefitted(experiment, fit), squares);
}

TEST_F(FitTest, RefittedHeldOutErrorEndsWhenItIsCancelled) {
  const Fit fit = *FitModel(experiment, Free({"object_push"}));
  experiment.cancelled = [] { return true; };
  EXPECT_EQ(HeldOutRmseRefitted(experiment, fit).status().code(), absl::StatusCode::kCancelled);
}

TEST_F(FitTest, HeldOutSquaresOfPartsSumToTheHeldOutErrorAndFitsMadeAnewAgree) {
  rows.measured += kPushM * rows.columns["object_push"];
  const Fit fit = *FitModel(experiment, Free({"object_push"}));
  const std::vector<double> squares = HeldOutSquares(experiment, fit);
  const std::vector<double> anew = *HeldOutSquaresRefitted(experiment, fit);
  ASSERT_EQ(squares.size(), 4u);  // groups
  ASSERT_EQ(anew.size(), 4u);
  double sum = 0;
  for (int part = 0; part < 4; ++part) {
    sum += squares[part];
    EXPECT_NEAR(squares[part], anew[part], 1e-3 * anew[part]);
  }
  EXPECT_NEAR(std::sqrt(sum / rows.rows()), HeldOutRmse(experiment, fit), 1e-12);
}

// Rows whose error the model itself tells where a fit did not see them.
class RowsWithTheirOwnUnseenSquares : public LinearTestModel {
 public:
  using LinearTestModel::LinearTestModel;
  std::optional<double> SquaresOfUnseen(const model::Model& model,
                                        const std::vector<int>& unseen) const override {
    return model.effects[0].values[0] * static_cast<double>(unseen.size());
  }
};

TEST(HeldOut, SquaresAreThoseThatRowsWithValuesOfTheirOwnTell) {
  RowsWithTheirOwnUnseenSquares rows(4, 5, 2);
  rows.columns["object_push"] = rows.Random(1, kColumn);
  rows.measured = kPushM * rows.columns["object_push"];
  const Likelihood likelihood(rows.GroupRows(), nullptr, 0, nullptr);
  Experiment experiment;
  experiment.observations = &rows;
  experiment.likelihood = &likelihood;
  Parameterization model(model::NominalModel(), rows.groups());
  model.Add(effects::Catalogue().Find("object_push"), false);
  const Fit fit = *FitModel(experiment, model);
  const std::vector<double> linear = HeldOutSquares(experiment, fit);
  const std::vector<double> anew = *HeldOutSquaresRefitted(experiment, fit);
  for (int part = 0; part < 4; ++part) {
    EXPECT_NEAR(linear[part], 10 * kPushM, 1e-7);
    EXPECT_NEAR(anew[part], 10 * kPushM, 1e-7);
  }
}

TEST(HeldOut, FallIsTheMeanLogarithmOverPartsWithItsStandardError) {
  const HeldOutFall fall = FallOfHeldOut({std::exp(1.0), std::exp(3.0)}, {1, 1}, 0);
  EXPECT_NEAR(fall.mean, 2, 1e-12);
  EXPECT_NEAR(fall.std_error, 1, 1e-12);
  EXPECT_EQ(FallOfHeldOut({0, 0}, {0, 0}, 1e-9).mean, 0);
}

TEST(Likelihood, ValuesThatPredictionsFitAreNoDegreesOfFreedomOfTheNoise) {
  Likelihood likelihood({0, 100}, nullptr, 0, nullptr);
  likelihood.SetEliminated(20);
  EXPECT_NEAR(likelihood.Sigma(4 * 80, 0), 2, 1e-12);
  EXPECT_NEAR(likelihood.Sigma(4 * 70, 10), 2, 1e-12);
  EXPECT_NEAR(likelihood.LogLikelihood(4 * 80, 0), -40 * std::log(4.0), 1e-12);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
