// Uncertainty budgets of pictures: how sure a fitted camera's or lens's predictions are, by how every reading changes with the
// values that were fitted (JCGM 100:2008, 5.2.2). A reading is a pixel (grey levels) or a corner (pixels).
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "server/uncertainty/budget.h"

namespace touchstone::uncertainty {

// Values of a fit, of which the readings are nearly linear.
struct FittedValues {
  std::vector<std::string> effects;  // "exposure", "formula shade"
  std::vector<int> effect_of_value;  // index into effects, one per value
  Eigen::MatrixXd covariance;        // of the values
};

class PictureBudgetSum {
 public:
  // `repeatability`: standard deviation of one reading, in its unit.
  PictureBudgetSum(FittedValues values, double repeatability)
      : values_(std::move(values)), repeatability_(repeatability) {}

  // A picture of an object; empty: of none. `products`: mean over its readings of d_i d_j, the derivatives by values i and j.
  void Add(const std::string& object, const Eigen::MatrixXd& products);
  // One per object that was added, by name, then one of all; Budget::touches counts pictures.
  std::vector<Budget> Budgets() const;

 private:
  struct Sums {
    int pictures = 0;
    double largest = 0;  // variance of the values' part in the worst picture
    Eigen::MatrixXd products;
  };
  double Variance(const Eigen::MatrixXd& products) const;
  Budget BudgetOf(const std::string& object, const Sums& sums) const;

  FittedValues values_;
  double repeatability_;
  std::map<std::string, Sums> objects_;
};

}  // namespace touchstone::uncertainty
