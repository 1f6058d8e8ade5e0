// Uncertainty budgets: root mean squares of standard uncertainties over many touches, object by object.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/uncertainty/predicted_times.h"

namespace touchstone::uncertainty {

struct Contribution {
  std::string name;  // an effect, "surface", "repeatability", "reproducibility", "misfit"
  double std_uncertainty = 0;
  double share = 0;  // of the combined variance
};

// See v1::UncertaintyBudget; in the unit of what is predicted: seconds, grey levels, pixels.
struct Budget {
  std::string object;  // empty: all
  int touches = 0;     // of which two fingers or more meet the object; or pictures
  double parameters = 0, surface = 0, repeatability = 0;
  std::optional<double> reproducibility;
  double combined = 0;
  double largest = 0;  // combined, of the worst finger of the worst touch; of the worst picture
  std::vector<Contribution> contributions;  // largest first
  int beyond_measured = 0;                  // touches
};

// A contribution that is independent of the others and the same for every finger; changes the combined ones and all shares.
void AddContribution(const std::string& name, double std_uncertainty, Budget* budget);

// What a model leaves of the readings that it was fitted to.
struct ModelError {
  double rmse = 0, noise = 0;  // one unit
  double lack_of_fit_p = 1;
};
// Adds "misfit", the part of that error which the others do not account for, if the reduced chi square is above 1 and not by
// chance. `share`: of the error's square that is the error of what is predicted. The last budget is of all.
void AddMisfit(const ModelError& error, double share, std::vector<Budget>* budgets);

// In another unit, which is `factor` smaller.
Budget Scaled(Budget budget, double factor);

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
