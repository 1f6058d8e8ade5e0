// Uncertainty budgets: root mean squares of standard uncertainties over many touches, object by object.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/uncertainty/predicted_times.h"

namespace touchstone::uncertainty {

struct Contribution {
  std::string name;  // an effect, "surface", "repeatability", "reproducibility"
  double std_uncertainty_s = 0;
  double share = 0;  // of the combined variance
};

// See v1::UncertaintyBudget; seconds.
struct Budget {
  std::string object;  // empty: all
  int touches = 0;     // of which two fingers or more meet the object
  double parameters_s = 0, surface_s = 0, repeatability_s = 0;
  std::optional<double> reproducibility_s;
  double combined_s = 0;
  double largest_s = 0;                     // combined, of the worst finger of the worst touch
  std::vector<Contribution> contributions;  // largest first
  int beyond_measured = 0;                  // touches
};

class BudgetSum {
 public:
  explicit BudgetSum(const PredictedTimes& of)
      : effects_(of.effects()), has_reproducibility_(of.has_reproducibility()) {}

  // Touches of one object.
  void Add(const std::string& object, const TimeUncertainty& touches);
  // One per object that was added, by name, then one of all.
  std::vector<Budget> Budgets() const;

 private:
  struct Sums {
    int touches = 0, beyond = 0;
    double fingers = 0, parameters = 0, surface = 0, repeatability = 0, reproducibility = 0, largest = 0;
    std::vector<double> effects;
  };
  Budget BudgetOf(const std::string& object, const Sums& sums) const;

  std::vector<std::string> effects_;
  bool has_reproducibility_;
  std::map<std::string, Sums> objects_;
};

}  // namespace touchstone::uncertainty
