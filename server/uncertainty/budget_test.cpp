#include "server/uncertainty/picture_budget.h"

#include <gtest/gtest.h>

#include <cmath>

namespace touchstone::uncertainty {
namespace {

// Two effects, the second of two values, correlated within and between.
FittedValues Values() {
  FittedValues values;
  values.effects = {"exposure", "light_position"};
  values.effect_of_value = {0, 1, 1};
  values.covariance = (Eigen::MatrixXd(3, 3) << 4, 1, 0, 1, 9, 2, 0, 2, 1).finished();
  return values;
}

TEST(PictureBudget, IsTheVarianceOfALinearPrediction) {
  PictureBudgetSum sum(Values(), 3);
  const Eigen::Vector3d near(1, 2, -1), far(2, 0, 1);  // derivatives of every reading of a picture
  sum.Add("cup", near * near.transpose());
  sum.Add("die", far * far.transpose());
  const std::vector<Budget> budgets = sum.Budgets();
  ASSERT_EQ(budgets.size(), 3u);
  const double cup = near.dot(Values().covariance * near), die = far.dot(Values().covariance * far);
  EXPECT_NEAR(budgets[0].parameters, std::sqrt(cup), 1e-12);
  EXPECT_NEAR(budgets[1].combined, std::sqrt(die + 9), 1e-12);
  const Budget& all = budgets[2];
  EXPECT_EQ(all.touches, 2);
  EXPECT_NEAR(all.combined, std::sqrt((cup + die) / 2 + 9), 1e-12);
  EXPECT_NEAR(all.largest, std::sqrt(std::max(cup, die) + 9), 1e-12);
  ASSERT_EQ(all.contributions.size(), 3u);
  for (const Contribution& one : all.contributions)
    if (one.name == "exposure") {
      EXPECT_NEAR(one.std_uncertainty, std::sqrt((4 + 16) / 2.0), 1e-12);
    }
  EXPECT_GE(all.contributions[0].share, all.contributions[1].share);
}

TEST(PictureBudget, OfNoValuesIsTheNoise) {
  FittedValues none;
  none.covariance.resize(0, 0);
  PictureBudgetSum sum(none, 2);
  sum.Add("", Eigen::MatrixXd(0, 0));
  const std::vector<Budget> budgets = sum.Budgets();
  ASSERT_EQ(budgets.size(), 1u);
  EXPECT_EQ(budgets[0].combined, 2);
  EXPECT_EQ(budgets[0].contributions[0].name, "repeatability");
}

TEST(Budget, AMisfitIsWhatTheOthersLeave) {
  Budget budget;
  budget.combined = 3, budget.largest = 4;
  budget.contributions = {{"repeatability", 3, 1}};
  std::vector<Budget> budgets = {budget};
  AddMisfit({4.9, 5, 1e-9}, 1, &budgets);  // the error is less than the noise
  AddMisfit({5, 3, 0.2}, 1, &budgets);     // chance
  EXPECT_EQ(budgets[0].combined, 3);
  AddMisfit({5, 3, 1e-9}, 1, &budgets);
  EXPECT_NEAR(budgets[0].combined, 5, 1e-12);
  EXPECT_NEAR(budgets[0].largest, std::sqrt(16 + 16), 1e-12);
  EXPECT_EQ(budgets[0].contributions[0].name, "misfit");
  EXPECT_NEAR(budgets[0].contributions[0].share, 16.0 / 25, 1e-12);
  EXPECT_NEAR(budgets[0].contributions[1].share, 9.0 / 25, 1e-12);
}

}  // namespace
}  // namespace touchstone::uncertainty
