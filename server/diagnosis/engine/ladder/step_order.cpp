#include "server/diagnosis/engine/ladder/step_order.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "server/base/status.h"
#include "server/diagnosis/engine/ladder/rules.h"
#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {
namespace {

// The model with only those of its further effects that are in `kept`.
Parameterization Only(const Parameterization& model, int initial_effects, const std::set<int>& kept) {
  Parameterization part = model;
  for (int index = static_cast<int>(model.base().effects.size()) - 1; index >= initial_effects; --index)
    if (kept.count(index) == 0) part = part.Without(index);
  return part;
}

// Depth first, the step that explains most before the others; a set of steps from which no order leads on is left alone.
class Orderer {
 public:
  Orderer(const Experiment& experiment, const Explanation& whole, int nameless,
          const std::vector<SelectedStep>& steps, const ErrorOfStep& error_of)
      : experiment_(experiment), whole_(whole), nameless_(nameless), steps_(steps), error_of_(error_of) {}

  absl::StatusOr<StepOrder> Run(const Quality& before) {
    StepOrder order;
    TOUCHSTONE_ASSIGN_OR_RETURN(const SelectedStep* idle, FirstWithoutGain(before));
    if (idle != nullptr) {
      order.without_gain = idle->effect;
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool last, FallsAfterAllOthers(*idle));
      if (!last) return order;
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, Extend({}, before));
      TOUCHSTONE_ASSIGN_OR_RETURN(order.without_gain, found ? absl::StatusOr<int>(-1) : ExplainsLeast());
      if (!found) return order;
    }
    for (const auto& [step, kept] : chosen_) {
      order.steps.push_back(Ordered(*step, kept, fits_.at(kept)));
      order.steps.back().quality = qualities_.at(kept);
    }
    return order;
  }

 private:
  using Effects = std::set<int>;

  bool IsLast(const Effects& kept) const { return kept.size() == steps_.size(); }
  bool IsWhole(const Effects& kept) const { return IsLast(kept) && nameless_ < 0; }
  OrderedStep Ordered(const SelectedStep& step, const Effects& kept, Fit fit) const {
    return {&step, std::move(fit), IsLast(kept), IsWhole(kept), {}};
  }

  absl::StatusOr<const Fit*> FitOf(const Effects& kept) {
    const auto known = fits_.find(kept);
    if (known != fits_.end()) return &known->second;
    absl::StatusOr<Fit> fit =
        IsWhole(kept) ? whole_.fit
                      : FitModel(experiment_, Only(whole_.fit.model, whole_.initial_effects, kept));
    TOUCHSTONE_RETURN_IF_ERROR(fit.status());
    return &fits_.emplace(kept, *std::move(fit)).first->second;
  }

  absl::StatusOr<Quality> QualityOf(const SelectedStep& step, const Effects& kept, const Quality& last) {
    const auto known = qualities_.find(kept);
    if (known != qualities_.end()) return known->second;
    TOUCHSTONE_ASSIGN_OR_RETURN(const Fit* fit, FitOf(kept));
    TOUCHSTONE_ASSIGN_OR_RETURN(const Quality quality, error_of_(Ordered(step, kept, *fit), last));
    if (std::isfinite(quality.heldout_rmse)) qualities_.emplace(kept, quality);
    return quality;
  }

  // Each step that is open, with the effects kept if it comes next; the one that explains most first.
  absl::StatusOr<std::vector<std::pair<const SelectedStep*, Effects>>> Next(const Effects& kept) {
    std::vector<std::pair<double, const SelectedStep*>> open;
    for (const SelectedStep& step : steps_) {
      if (kept.count(step.effect) > 0) continue;
      Effects with = kept;
      with.insert(step.effect);
      TOUCHSTONE_ASSIGN_OR_RETURN(const Fit* fit, FitOf(with));
      open.emplace_back(fit->log_evidence, &step);
    }
    std::stable_sort(open.begin(), open.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<std::pair<const SelectedStep*, Effects>> next;
    for (const auto& [log_evidence, step] : open) {
      next.emplace_back(step, kept);
      next.back().second.insert(step->effect);
    }
    return next;
  }

  // Whether the others follow those kept in some order; `chosen_` has it.
  absl::StatusOr<bool> Extend(const Effects& kept, const Quality& last) {
    if (IsLast(kept)) return true;
    if (dead_ends_.count(kept) > 0 || static_cast<int>(fits_.size()) > kLadderRules.max_fits) return false;
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto next, Next(kept));
    for (const auto& [step, with] : next) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const Quality quality, QualityOf(*step, with, last));
      if (!Falls(last, quality, *step)) continue;
      chosen_.emplace_back(step, with);
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool done, Extend(with, quality));
      if (done) return true;
      chosen_.pop_back();
    }
    dead_ends_.insert(kept);
    return false;
  }

  // The first step without gain where what explains most comes first; null: each has gain, and `chosen_` is that order.
  absl::StatusOr<const SelectedStep*> FirstWithoutGain(const Quality& before) {
    Effects kept;
    Quality last = before;
    while (!IsLast(kept)) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const auto next, Next(kept));
      kept = next[0].second;
      TOUCHSTONE_ASSIGN_OR_RETURN(const Quality quality, QualityOf(*next[0].first, kept, last));
      if (!Falls(last, quality, *next[0].first)) {
        chosen_.clear();
        return next[0].first;
      }
      chosen_.push_back(next[0]);
      last = quality;
    }
    return nullptr;
  }

  Effects AllBut(int effect) const {
    Effects others;
    for (const SelectedStep& step : steps_)
      if (step.effect != effect) others.insert(step.effect);
    return others;
  }

  absl::StatusOr<bool> FallsAfterAllOthers(const SelectedStep& step) {
    if (steps_.size() == 1) return false;
    const SelectedStep& other = steps_[&step == &steps_[0] ? 1 : 0];
    const Quality anything = {INFINITY, INFINITY, 0};
    TOUCHSTONE_ASSIGN_OR_RETURN(const Quality without, QualityOf(other, AllBut(step.effect), anything));
    TOUCHSTONE_ASSIGN_OR_RETURN(const Quality with, QualityOf(step, AllBut(-1), anything));
    return Falls(without, with, step);
  }

  // The effect without which the others explain most; one that has no gain after them, if there is any.
  absl::StatusOr<int> ExplainsLeast() {
    std::pair<bool, double> most = {false, -INFINITY};
    int chosen = -1;
    for (const SelectedStep& step : steps_) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool falls, FallsAfterAllOthers(step));
      TOUCHSTONE_ASSIGN_OR_RETURN(const Fit* others, FitOf(AllBut(step.effect)));
      const std::pair<bool, double> without = {!falls, others->log_evidence};
      if (without <= most) continue;
      most = without;
      chosen = step.effect;
    }
    return chosen;
  }

  const Experiment& experiment_;
  const Explanation& whole_;
  const int nameless_;
  const std::vector<SelectedStep>& steps_;
  const ErrorOfStep& error_of_;
  std::map<Effects, Fit> fits_;
  std::map<Effects, Quality> qualities_;
  std::set<Effects> dead_ends_;
  std::vector<std::pair<const SelectedStep*, Effects>> chosen_;
};

}  // namespace

bool Falls(const Quality& before, const Quality& after, const SelectedStep& step) {
  const double kept = step.probability < kLadderRules.doubtful ? 1 - SearchRules().min_relative_cv_gain : 1;
  return after.rmse < before.rmse && after.heldout_rmse < kept * before.heldout_rmse;
}

absl::StatusOr<StepOrder> OrderSteps(const Experiment& experiment, const Explanation& whole, int nameless,
                                     const std::vector<SelectedStep>& steps, const Quality& before,
                                     const ErrorOfStep& error_of) {
  return Orderer(experiment, whole, nameless, steps, error_of).Run(before);
}

}  // namespace touchstone::diagnosis::engine
