#include "server/uncertainty/budget.h"

#include <algorithm>
#include <cmath>

namespace touchstone::uncertainty {
namespace {

constexpr double kMisfitP = 0.05;

void SortByShare(std::vector<Contribution>* contributions) {
  std::stable_sort(contributions->begin(), contributions->end(),
                   [](const Contribution& a, const Contribution& b) { return a.share > b.share; });
}

}  // namespace

void AddContribution(const std::string& name, double std_uncertainty, Budget* budget) {
  const double before = budget->combined * budget->combined;
  budget->combined = std::hypot(budget->combined, std_uncertainty);
  budget->largest = std::hypot(budget->largest, std_uncertainty);
  const double all = budget->combined * budget->combined;
  if (!(all > 0)) return;
  for (Contribution& contribution : budget->contributions) contribution.share *= before / all;
  budget->contributions.push_back({name, std_uncertainty, std_uncertainty * std_uncertainty / all});
  SortByShare(&budget->contributions);
}

void AddMisfit(const ModelError& error, double share, std::vector<Budget>* budgets) {
  if (budgets->empty() || !(error.rmse > error.noise) || !(error.lack_of_fit_p < kMisfitP)) return;
  const double combined = budgets->back().combined;
  const double left = error.rmse * error.rmse * share - combined * combined;
  if (!(left > 0)) return;
  for (Budget& budget : *budgets) AddContribution("misfit", std::sqrt(left), &budget);
}

Budget Scaled(Budget budget, double factor) {
  for (double* value :
       {&budget.parameters, &budget.surface, &budget.repeatability, &budget.combined, &budget.largest})
    *value *= factor;
  if (budget.reproducibility) *budget.reproducibility *= factor;
  for (Contribution& contribution : budget.contributions) contribution.std_uncertainty *= factor;
  return budget;
}

void BudgetSum::Add(const std::string& object, const TimeUncertainty& touches) {
  Sums& sums = objects_[object];
  sums.effects.resize(effects_.size(), 0);
  const auto square = [](double value) { return value * value; };
  const size_t fingers = static_cast<size_t>(touches.fingers);
  for (size_t first = 0; first < touches.combined_s.size(); first += fingers) {
    bool met = false, beyond = false;
    for (size_t e = first; e < first + fingers; ++e) {
      if (std::isnan(touches.combined_s[e])) continue;
      met = true;
      beyond |= touches.beyond_measured[e] != 0;
      sums.fingers += 1;
      sums.parameters += square(touches.parameters_s[e]);
      sums.surface += square(touches.surface_s[e]);
      sums.repeatability += square(touches.repeatability_s[e]);
      sums.reproducibility += square(touches.reproducibility_s[e]);
      sums.largest = std::max(sums.largest, touches.combined_s[e]);
      for (size_t j = 0; j < effects_.size(); ++j) sums.effects[j] += square(touches.effects_s[j][e]);
    }
    sums.touches += met;
    sums.beyond += beyond;
  }
}

Budget BudgetSum::BudgetOf(const std::string& object, const Sums& sums) const {
  Budget budget;
  budget.object = object;
  budget.touches = sums.touches;
  budget.beyond_measured = sums.beyond;
  if (sums.fingers == 0) return budget;
  const auto root = [&sums](double sum) { return std::sqrt(sum / sums.fingers); };
  budget.parameters = root(sums.parameters);
  budget.surface = root(sums.surface);
  budget.repeatability = root(sums.repeatability);
  if (has_reproducibility_) budget.reproducibility = root(sums.reproducibility);
  const double all = sums.parameters + sums.surface + sums.repeatability + sums.reproducibility;
  budget.combined = root(all);
  budget.largest = sums.largest;
  const auto add = [&](const std::string& name, double sum) {
    budget.contributions.push_back({name, root(sum), all > 0 ? sum / all : 0});
  };
  for (size_t j = 0; j < effects_.size(); ++j) add(effects_[j], sums.effects[j]);
  add("surface", sums.surface);
  add("repeatability", sums.repeatability);
  if (has_reproducibility_) add("reproducibility", sums.reproducibility);
  SortByShare(&budget.contributions);
  return budget;
}

std::vector<Budget> BudgetSum::Budgets() const {
  std::vector<Budget> budgets;
  Sums all;
  all.effects.resize(effects_.size(), 0);
  for (const auto& [object, sums] : objects_) {
    budgets.push_back(BudgetOf(object, sums));
    all.touches += sums.touches, all.beyond += sums.beyond, all.fingers += sums.fingers;
    all.parameters += sums.parameters, all.surface += sums.surface;
    all.repeatability += sums.repeatability, all.reproducibility += sums.reproducibility;
    all.largest = std::max(all.largest, sums.largest);
    for (size_t j = 0; j < effects_.size(); ++j) all.effects[j] += sums.effects[j];
  }
  budgets.push_back(BudgetOf("", all));
  return budgets;
}

}  // namespace touchstone::uncertainty
