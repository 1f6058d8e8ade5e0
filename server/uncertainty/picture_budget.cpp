#include "server/uncertainty/picture_budget.h"

#include <algorithm>
#include <cmath>

namespace touchstone::uncertainty {

double PictureBudgetSum::Variance(const Eigen::MatrixXd& products) const {
  return std::max(products.cwiseProduct(values_.covariance).sum(), 0.0);
}

void PictureBudgetSum::Add(const std::string& object, const Eigen::MatrixXd& products) {
  Sums& sums = objects_[object];
  if (sums.pictures++ == 0) sums.products = Eigen::MatrixXd::Zero(products.rows(), products.cols());
  sums.products += products;
  sums.largest = std::max(sums.largest, Variance(products));
}

Budget PictureBudgetSum::BudgetOf(const std::string& object, const Sums& sums) const {
  Budget budget;
  budget.object = object;
  budget.touches = sums.pictures;
  if (sums.pictures == 0) return budget;
  const Eigen::MatrixXd products = sums.products / sums.pictures;
  const double values = Variance(products), noise = repeatability_ * repeatability_;
  budget.parameters = std::sqrt(values);
  budget.repeatability = repeatability_;
  budget.combined = std::sqrt(values + noise);
  budget.largest = std::sqrt(sums.largest + noise);
  const auto add = [&](const std::string& name, double variance) {
    budget.contributions.push_back(
        {name, std::sqrt(variance), values + noise > 0 ? variance / (values + noise) : 0});
  };
  for (int effect = 0; effect < static_cast<int>(values_.effects.size()); ++effect) {
    Eigen::VectorXd own = Eigen::VectorXd::Zero(products.rows());
    for (Eigen::Index i = 0; i < own.size(); ++i) own[i] = values_.effect_of_value[i] == effect;
    add(values_.effects[effect], Variance(own.asDiagonal() * products * own.asDiagonal()));
  }
  add("repeatability", noise);
  std::stable_sort(budget.contributions.begin(), budget.contributions.end(),
                   [](const Contribution& a, const Contribution& b) { return a.share > b.share; });
  return budget;
}

std::vector<Budget> PictureBudgetSum::Budgets() const {
  std::vector<Budget> budgets;
  Sums all;
  for (const auto& [object, sums] : objects_) {
    if (!object.empty()) budgets.push_back(BudgetOf(object, sums));
    if (all.pictures == 0) all.products = Eigen::MatrixXd::Zero(sums.products.rows(), sums.products.cols());
    all.pictures += sums.pictures;
    all.products += sums.products;
    all.largest = std::max(all.largest, sums.largest);
  }
  budgets.push_back(BudgetOf("", all));
  return budgets;
}

}  // namespace touchstone::uncertainty
