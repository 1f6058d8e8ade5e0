#include "server/diagnosis/distributions/compatible_effects.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/distributions/effect_variation.h"
#include "server/diagnosis/distributions/rules.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::distributions {
namespace {

constexpr double kStrengths[] = {0.5, 1, 3, 9};  // of the typical value
// Step sizes: octaves of the strength, and factors of the steps above. A strength must be right to a few per
// cent, poses need not: steps below fine_step leave them alone.
constexpr double kSteps[] = {1, 0.5, 0.5, 0.25, 0.12, 0.06, 0.03, 0.015};
// Shares of the progress: screening, one evaluation of all, one step.
constexpr double kScreeningShare = 0.5, kFirstEvaluationShare = 0.05, kStepShare = 0.04;

// One variation of the model, the assumed poses, and the misfit with them.
struct Trial {
  EffectDirection direction;
  std::vector<double> amounts;  // [entry of the parameter], SI
  AssumedPoses poses;
  PoseFreeMisfit misfit{HUGE_VAL, 0};
};

// Evaluates a trial; it replaces `best` if its misfit is smaller.
absl::Status Attempt(const model::Model& model, Trial trial, ReferenceSize size, const MisfitOfModel& misfit,
                     Trial* best) {
  const auto varied = Varied(model, trial.direction, trial.amounts);
  if (!varied) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(trial.misfit, misfit(varied, trial.poses, size));
  if (trial.misfit.distance < best->misfit.distance) *best = trial;
  return absl::OkStatus();
}

// The best of a few strengths along one direction with each of `poses`, against quick references.
absl::Status Screen(const model::Model& model, const EffectDirection& direction,
                    const std::vector<AssumedPoses>& poses, const MisfitOfModel& misfit, Trial* best) {
  const model::ParameterInfo& info = direction.effect->parameters[direction.parameter];
  const double typical =
      ToSi(info.unit, info.typical != 0 ? std::abs(info.typical) : 0.05 * (info.upper - info.lower));
  for (const AssumedPoses& supposed : poses)
    for (const double strength : kStrengths)
      for (const double sign : {-1.0, 1.0}) {
        Trial trial{direction, std::vector<double>(info.Count(model.fingers)), supposed};
        trial.amounts[direction.entry] = sign * strength * typical;
        TOUCHSTONE_RETURN_IF_ERROR(Attempt(model, trial, ReferenceSize::kQuick, misfit, best));
      }
  return absl::OkStatus();
}

// The trial with one quantity moved by `step` (signed): 0: the strength, 1: the poses' tilt, 2: their spread,
// 3...: the other entries of its parameter.
Trial Moved(const Trial& trial, size_t what, double step) {
  Trial moved = trial;
  double& amount = moved.amounts[trial.direction.entry];
  double& tilt_rad = moved.poses.max_tilt_rad;
  if (what == 0)
    amount *= std::exp2(step);
  else if (what == 1)
    tilt_rad = std::clamp(tilt_rad + step * (kDistributionRules.tilt_step_deg * kRadiansPerDegree), 0.0,
                          kDistributionRules.max_tilt_deg * kRadiansPerDegree);
  else if (what == 2)
    moved.poses.spread = std::clamp(moved.poses.spread + step * kDistributionRules.spread_step, 0.1, 1.0);
  else
    moved.amounts[(trial.direction.entry + what - 2) % trial.amounts.size()] += 0.5 * step * amount;
  return moved;
}

// Coordinate descent over the strength, the poses' tilt and spread (poses that were fitted without the effect
// imitate a part of it) and the other fingers or axes. Stops where the sets are clearly compatible.
// `promising`: poses that suit another effect.
absl::Status Refine(const model::Model& model, double step, const AssumedPoses& promising,
                    const MisfitOfModel& misfit, Trial* best) {
  if (best->misfit.p_value > kDistributionRules.clearly_compatible_p) return absl::OkStatus();
  Trial trial = *best;
  trial.poses = promising;
  TOUCHSTONE_RETURN_IF_ERROR(Attempt(model, trial, ReferenceSize::kFull, misfit, best));
  const model::ParameterInfo& info = trial.direction.effect->parameters[trial.direction.parameter];
  const size_t free = trial.amounts.size() - (info.sum_zero ? 1 : 0);
  for (size_t what = 0; what < 2 + free; ++what) {
    if (step < kDistributionRules.fine_step && (what == 1 || what == 2)) continue;
    bool moved = false;
    for (const double sign : {-1.0, 1.0}) {
      for (int n = 0; n < kDistributionRules.max_moves && !(moved && n == 0); ++n) {
        if (best->misfit.p_value > kDistributionRules.clearly_compatible_p) return absl::OkStatus();
        const double before = best->misfit.distance;
        TOUCHSTONE_RETURN_IF_ERROR(
            Attempt(model, Moved(*best, what, sign * step), ReferenceSize::kFull, misfit, best));
        if (!(best->misfit.distance < before)) break;
        moved = true;
      }
    }
  }
  return absl::OkStatus();
}

using Progress = std::function<bool(double done)>;

class CompatibleEffectSearch {
 public:
  CompatibleEffectSearch(const model::Model& model, MisfitOfModel misfit, ThreadPool* pool,
                         const Progress& progress)
      : model_(model), misfit_(std::move(misfit)), pool_(pool), progress_(progress) {}

  // Leaves the best directions of the best effects.
  absl::Status ScreenAll(const std::vector<EffectDirection>& directions,
                         const std::vector<AssumedPoses>& poses);
  absl::Status RefineAll(const RenewMisfit& renew);
  std::vector<CompatibleEffect> Compatible();

 private:
  // Runs body(n) for n < count in portions, so that progress and cancelling stay with this thread.
  template <typename Body>
  absl::Status InPortions(size_t count, double share, const Body& body);
  // All trials by the present misfit.
  absl::Status Evaluate(double share);
  const Trial& Leader() const;
  // Trials that are far behind do not catch up.
  void DropHopeless();

  const model::Model& model_;
  MisfitOfModel misfit_;
  ThreadPool* const pool_;
  const Progress& progress_;
  double done_ = 0;  // of the progress
  std::vector<Trial> trials_;
};

template <typename Body>
absl::Status CompatibleEffectSearch::InPortions(size_t count, double share, const Body& body) {
  std::vector<absl::Status> status(count);
  const size_t portion = pool_ ? pool_->size() + 1 : 1;
  for (size_t begin = 0; begin < count; begin += portion) {
    if (progress_ && !progress_(done_ + share * begin / count)) return absl::CancelledError("cancelled");
    const size_t end = std::min(count, begin + portion);
    const auto run = [&](int a, int b) {
      for (int n = a; n < b; ++n) status[begin + n] = body(begin + n);
    };
    ParallelFor(pool_, static_cast<int>(end - begin), 1, run);
    for (size_t n = begin; n < end; ++n) TOUCHSTONE_RETURN_IF_ERROR(status[n]);
  }
  done_ += share;
  return absl::OkStatus();
}

absl::Status CompatibleEffectSearch::ScreenAll(const std::vector<EffectDirection>& directions,
                                               const std::vector<AssumedPoses>& poses) {
  std::vector<Trial> screened(directions.size());
  TOUCHSTONE_RETURN_IF_ERROR(InPortions(directions.size(), kScreeningShare, [&](size_t d) {
    return Screen(model_, directions[d], poses, misfit_, &screened[d]);
  }));
  std::stable_sort(screened.begin(), screened.end(),
                   [](const Trial& a, const Trial& b) { return a.misfit.distance < b.misfit.distance; });
  for (const Trial& trial : screened) {
    if (trials_.size() == kDistributionRules.max_refined || trial.misfit.distance == HUGE_VAL) break;
    const auto of_effect = std::count_if(trials_.begin(), trials_.end(), [&](const Trial& other) {
      return other.direction.effect == trial.direction.effect;
    });
    if (of_effect < kDistributionRules.max_refined_per_effect) trials_.push_back(trial);
  }
  return absl::OkStatus();
}

absl::Status CompatibleEffectSearch::Evaluate(double share) {
  return InPortions(trials_.size(), share, [&](size_t n) {
    const Trial start = trials_[n];
    trials_[n].misfit = {HUGE_VAL, 0};  // by another measure: not comparable
    return Attempt(model_, start, ReferenceSize::kFull, misfit_, &trials_[n]);
  });
}

const Trial& CompatibleEffectSearch::Leader() const {
  return *std::min_element(trials_.begin(), trials_.end(), [](const Trial& a, const Trial& b) {
    return a.misfit.distance < b.misfit.distance;
  });
}

void CompatibleEffectSearch::DropHopeless() {
  const double smallest = Leader().misfit.distance;
  trials_.erase(std::remove_if(trials_.begin(), trials_.end(),
                               [&](const Trial& trial) {
                                 return trial.misfit.p_value < kDistributionRules.hopeless_p &&
                                        trial.misfit.distance > 2 * smallest + 2;
                               }),
                trials_.end());
}

absl::Status CompatibleEffectSearch::RefineAll(const RenewMisfit& renew) {
  if (trials_.empty()) return absl::OkStatus();
  TOUCHSTONE_RETURN_IF_ERROR(Evaluate(kFirstEvaluationShare));
  for (size_t s = 0; s < std::size(kSteps); ++s) {
    if (s == kDistributionRules.steps_before_renewal) {
      const Trial best = Leader();
      TOUCHSTONE_ASSIGN_OR_RETURN(misfit_, renew(Varied(model_, best.direction, best.amounts), best.poses));
      TOUCHSTONE_RETURN_IF_ERROR(Evaluate(kStepShare));
    }
    const AssumedPoses promising = Leader().poses;
    TOUCHSTONE_RETURN_IF_ERROR(InPortions(trials_.size(), kStepShare, [&](size_t n) {
      return Refine(model_, kSteps[s], promising, misfit_, &trials_[n]);
    }));
    DropHopeless();
  }
  return absl::OkStatus();
}

std::vector<CompatibleEffect> CompatibleEffectSearch::Compatible() {
  std::stable_sort(trials_.begin(), trials_.end(),
                   [](const Trial& a, const Trial& b) { return a.misfit.p_value > b.misfit.p_value; });
  std::vector<CompatibleEffect> compatible;
  for (const Trial& trial : trials_) {
    const std::string& name = trial.direction.effect->name;
    if (trial.misfit.p_value > kDistributionRules.compatible_p &&
        std::none_of(compatible.begin(), compatible.end(),
                     [&](const CompatibleEffect& effect) { return effect.effect == name; }))
      compatible.push_back(
          {name, VariationInWords(model_, trial.direction, trial.amounts), trial.misfit.p_value});
  }
  return compatible;
}

}  // namespace

absl::StatusOr<std::vector<CompatibleEffect>> FindCompatibleEffects(
    const model::Model& model, bool noise_is_known,
    const std::vector<std::shared_ptr<const model::Effect>>& also, const std::vector<AssumedPoses>& poses,
    MisfitOfModel misfit, const RenewMisfit& renew, ThreadPool* pool,
    const std::function<bool(double done)>& progress) {
  std::vector<std::shared_ptr<const model::Effect>> effects = effects::TouchEffects();
  effects.insert(effects.end(), also.begin(), also.end());
  std::vector<EffectDirection> directions;
  for (const auto& effect : effects) {
    if (!VisibleWithoutPoses(*effect, noise_is_known)) continue;
    const std::vector<EffectDirection> own = DirectionsOf(effect, model.fingers);
    directions.insert(directions.end(), own.begin(), own.end());
  }

  CompatibleEffectSearch search(model, std::move(misfit), pool, progress);
  TOUCHSTONE_RETURN_IF_ERROR(search.ScreenAll(directions, poses));
  TOUCHSTONE_RETURN_IF_ERROR(search.RefineAll(renew));
  return search.Compatible();
}

}  // namespace touchstone::diagnosis::distributions
