#include "server/diagnosis/joint/joint_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::joint {
namespace {

constexpr double kPerMetre = 50;
constexpr double kTruthM = 0.8e-3;

// One kind: rows that follow one column, with a known noise.
struct LinearKind {
  LinearKind(double noise, uint64_t seed) : rows(3, 40, 2) {
    rows.columns["object_push"] = rows.Random(seed, kPerMetre);
    rows.measured = rows.Random(seed + 1, noise) + kTruthM * rows.columns["object_push"];
    likelihood = std::make_unique<engine::Likelihood>(rows.GroupRows(), nullptr, 0, nullptr);
    experiment.observations = &rows;
    experiment.likelihood = likelihood.get();
    start = engine::Parameterization(model::NominalModel(), rows.groups());
    start.Add(effects::Catalogue().Find("object_push"), false);
  }
  Part part() const { return {&experiment, start, 1}; }
  double Alone() const {
    const Eigen::VectorXd& column = rows.columns.at("object_push");
    return column.dot(rows.measured) / column.squaredNorm();
  }
  double Precision(double value) const {
    const Eigen::VectorXd& column = rows.columns.at("object_push");
    return column.squaredNorm() * rows.rows() / (rows.measured - value * column).squaredNorm();
  }

  engine::LinearTestModel rows;
  std::unique_ptr<engine::Likelihood> likelihood;
  engine::Experiment experiment;
  engine::Parameterization start;
};

TEST(FitJointly, ValueIsTheMeanOfThreeKindsWeightedByTheirPrecisions) {
  const LinearKind one(0.002, 1), two(0.004, 11), three(0.008, 21);
  const auto fit = FitJointly({one.part(), two.part(), three.part()});
  ASSERT_TRUE(fit.ok()) << fit.status();
  ASSERT_EQ(fit->point.size(), 1);
  double sum = 0, precision = 0;
  for (const LinearKind* kind : {&one, &two, &three}) {
    const double weight = kind->Precision(fit->point[0]);
    sum += weight * kind->Alone(), precision += weight;
  }
  const double std_error = 1 / std::sqrt(precision);
  EXPECT_NEAR(fit->point[0], sum / precision, 0.02 * std_error);
  EXPECT_NEAR(std::sqrt(fit->covariance(0, 0)), std_error, 0.02 * std_error);
  for (int kind = 0; kind < 3; ++kind) EXPECT_EQ(fit->place[kind], std::vector<int>{0});
}

TEST(FitJointly, UntiedKindsKeepTheirOwnValues) {
  const LinearKind one(0.002, 1), two(0.004, 11);
  const auto fit =
      FitJointly({one.part(), two.part()}, [](const engine::Parameterization&, int) { return true; });
  ASSERT_TRUE(fit.ok()) << fit.status();
  ASSERT_EQ(fit->point.size(), 2);
  EXPECT_NEAR(fit->point[0], one.Alone(), 0.02 * std::sqrt(fit->covariance(0, 0)));
  EXPECT_NEAR(fit->point[1], two.Alone(), 0.02 * std::sqrt(fit->covariance(1, 1)));
}

TEST(FitJointly, KindThatScattersMoreThanItsRowsSayCountsLess) {
  const LinearKind one(0.002, 1), two(0.002, 11);
  Part scattered = two.part();
  scattered.variance_factor = 100;
  const auto fit = FitJointly({one.part(), scattered});
  ASSERT_TRUE(fit.ok()) << fit.status();
  EXPECT_NEAR(fit->point[0], one.Alone(), 0.2 * std::sqrt(fit->covariance(0, 0)));
}

}  // namespace
}  // namespace touchstone::diagnosis::joint
