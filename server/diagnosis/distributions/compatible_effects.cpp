#include "server/diagnosis/distributions/compatible_effects.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/effects/all_effects.h"

namespace touchstone {
namespace {

constexpr double kCompatibleP = 0.1;
constexpr double kPlainlyCompatibleP = 0.5;      // no need to look for better values
constexpr double kStrengths[] = {0.5, 1, 3, 9};  // of the typical value
constexpr size_t kRefined = 10;                  // directions that are looked at closely
constexpr int kRefinedOfAnEffect = 2;
constexpr double kTiltStepRad = 6 * kRadiansPerDegree, kMaxTiltRad = 50 * kRadiansPerDegree;
constexpr double kSpreadStep = 0.1;
constexpr int kMovesAStep = 3;  // in one direction
// Octaves of the strength, and of the steps above. A strength must be right to a few percent, poses need not.
constexpr double kSteps[] = {1, 0.5, 0.5, 0.25, 0.12, 0.06, 0.03, 0.015};
constexpr size_t kStepsBeforeRenewal = 2;
constexpr double kFineStep = 0.2;
constexpr double kHopelessP = 0.01;

// One number of one effect that is varied.
struct Direction {
  std::shared_ptr<const Effect> effect;
  int parameter = 0, entry = 0;
  int offset = 0;  // of the parameter in the flat values
};

// The model with `amounts` (SI, an entry each) added to one parameter, or set where the neutral value stands
// for infinity. Null if a value would leave its bounds.
std::shared_ptr<const Model> Varied(const Model& model, const Direction& direction,
                                    const std::vector<double>& amounts) {
  auto varied = std::make_shared<Model>(model);
  EffectInstance* instance = nullptr;
  for (EffectInstance& candidate : varied->effects)
    if (candidate.effect->name == direction.effect->name && !direction.effect->formula) instance = &candidate;
  if (!instance) {
    EffectInstance added;
    added.effect = direction.effect;
    added.per_object = direction.effect->always_per_object;
    added.values = direction.effect->NeutralValues(model.fingers);
    // The other parameters of the effect (the length of a bump) at their typical size.
    int offset = 0;
    for (size_t p = 0; p < direction.effect->parameters.size(); ++p) {
      const ParameterInfo& info = direction.effect->parameters[p];
      if (info.arity == Arity::kScalar && static_cast<int>(p) != direction.parameter && info.typical != 0 &&
          info.neutral != 0)
        added.values[offset] = ToSi(info.unit, info.typical);
      offset += info.Count(model.fingers);
    }
    varied->effects.push_back(std::move(added));
    instance = &varied->effects.back();
  }
  const ParameterInfo& info = direction.effect->parameters[direction.parameter];
  const int count = info.Count(model.fingers);
  const auto vary = [&](std::vector<double>* values) {
    if (static_cast<int>(values->size()) < direction.offset + count) return false;
    double* value = values->data() + direction.offset;
    double sum = 0;
    for (int i = 0; i < count; ++i) {
      sum += amounts[i];
      if (info.neutral == info.upper && info.neutral != 0 && amounts[i] != 0)
        value[i] = amounts[i];  // an acceleration, degrees of freedom: less is more
      else
        value[i] += amounts[i];
    }
    if (info.sum_zero)
      for (int i = 0; i < count; ++i) value[i] -= sum / count;
    for (int i = 0; i < count; ++i)
      if (value[i] < ToSi(info.unit, info.lower) || value[i] > ToSi(info.unit, info.upper)) return false;
    return true;
  };
  if (!vary(&instance->values)) return nullptr;
  for (auto& [object, values] : instance->object_values)
    if (!vary(&values)) return nullptr;
  return varied;
}

std::string InWords(const Model& model, const Direction& direction, const std::vector<double>& amounts) {
  const ParameterInfo& info = direction.effect->parameters[direction.parameter];
  double mean = 0;
  if (info.sum_zero)
    for (const double amount : amounts) mean += amount / amounts.size();
  std::vector<std::string> values;
  for (const double amount : amounts)
    values.push_back(absl::StrFormat("%.3g", FromSi(info.unit, amount - mean)));
  const auto model_has =
      std::any_of(model.effects.begin(), model.effects.end(),
                  [&](const EffectInstance& e) { return e.effect->name == direction.effect->name; });
  return absl::StrCat(info.name, model_has && info.neutral == 0 ? " changed by " : " = ",
                      values.size() == 1 ? values[0] : absl::StrCat("[", absl::StrJoin(values, ", "), "]"));
}

// What is missing cannot be seen in complete touches; "formula" alone changes nothing; rounds show the noise.
bool Worthwhile(const Effect& effect, bool noise_is_known) {
  if (noise_is_known && absl::EndsWith(effect.name, "_noise")) return false;
  return effect.name != "missed_contact" && effect.name != "formula" && !effect.parameters.empty() &&
         effect.needs.covariates.empty();
}

// Every number of an effect that says how much, each finger's and each axis's.
void AddDirections(const std::shared_ptr<const Effect>& effect, int fingers, std::vector<Direction>* list) {
  int offset = 0;
  for (size_t p = 0; p < effect->parameters.size(); ++p) {
    const ParameterInfo& info = effect->parameters[p];
    const int count = info.Count(fingers);
    // The length of bumps and the like are no strength: they say how, not how much.
    if (p == 0 || info.neutral == 0)
      for (int entry = 0; entry < count; ++entry)
        list->push_back({effect, static_cast<int>(p), entry, offset});
    offset += count;
  }
}

// One model and the poses it was judged with.
struct Trial {
  Direction direction;
  std::vector<double> amounts;  // an entry of the parameter each; the direction's own first of all
  SupposedPoses poses;
  UnposedMisfit misfit{HUGE_VAL, 0};
};

// Judges a trial; keeps it if it is better than `best`.
absl::Status Attempt(const Model& model, Trial trial, ReferenceSize size, const MisfitOfModel& misfit,
                     Trial* best) {
  const auto varied = Varied(model, trial.direction, trial.amounts);
  if (!varied) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(trial.misfit, misfit(varied, trial.poses, size));
  if (trial.misfit.distance < best->misfit.distance) *best = trial;
  return absl::OkStatus();
}

// The best of a few strengths along one direction, with each of `poses`, at a glance.
absl::Status Screen(const Model& model, const Direction& direction, const std::vector<SupposedPoses>& poses,
                    const MisfitOfModel& misfit, Trial* best) {
  const ParameterInfo& info = direction.effect->parameters[direction.parameter];
  const double typical =
      ToSi(info.unit, info.typical != 0 ? std::abs(info.typical) : 0.05 * (info.upper - info.lower));
  for (const SupposedPoses& supposed : poses)
    for (const double strength : kStrengths)
      for (const double sign : {-1.0, 1.0}) {
        Trial trial{direction, std::vector<double>(info.Count(model.fingers)), supposed};
        trial.amounts[direction.entry] = sign * strength * typical;
        TOUCHSTONE_RETURN_IF_ERROR(Attempt(model, trial, ReferenceSize::kQuick, misfit, best));
      }
  return absl::OkStatus();
}

// A trial moved by `step` up or down: 0: its strength, 1: the poses' tilt, 2: their spread, 3...: the other
// entries of its parameter.
Trial Moved(const Trial& trial, size_t what, double step) {
  Trial moved = trial;
  double& amount = moved.amounts[trial.direction.entry];
  double& tilt_rad = moved.poses.max_tilt_rad;
  if (what == 0)
    amount *= std::exp2(step);
  else if (what == 1)
    tilt_rad = std::clamp(tilt_rad + step * kTiltStepRad, 0.0, kMaxTiltRad);
  else if (what == 2)
    moved.poses.spread = std::clamp(moved.poses.spread + step * kSpreadStep, 0.1, 1.0);
  else
    moved.amounts[(trial.direction.entry + what - 2) % trial.amounts.size()] += 0.5 * step * amount;
  return moved;
}

// Steps of the strength, of the poses' tilt and spread (poses that were fitted without the effect have taken
// a part of what the effect does), of the other fingers or axes. Stops where the sets are plainly alike.
// `promising`: poses that suit another effect.
absl::Status Refine(const Model& model, double step, const SupposedPoses& promising,
                    const MisfitOfModel& misfit, Trial* best) {
  if (best->misfit.p > kPlainlyCompatibleP) return absl::OkStatus();
  Trial trial = *best;
  trial.poses = promising;
  TOUCHSTONE_RETURN_IF_ERROR(Attempt(model, trial, ReferenceSize::kFull, misfit, best));
  const ParameterInfo& info = trial.direction.effect->parameters[trial.direction.parameter];
  const size_t free = trial.amounts.size() - (info.sum_zero ? 1 : 0);
  for (size_t what = 0; what < 2 + free; ++what) {
    if (step < kFineStep && (what == 1 || what == 2)) continue;
    bool moved = false;
    for (const double sign : {-1.0, 1.0}) {
      for (int n = 0; n < kMovesAStep && !(moved && n == 0); ++n) {
        if (best->misfit.p > kPlainlyCompatibleP) return absl::OkStatus();
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

}  // namespace

absl::StatusOr<std::vector<CompatibleEffect>> FindCompatibleEffects(
    const Model& model, bool noise_is_known, const std::vector<std::shared_ptr<const Effect>>& also,
    const std::vector<SupposedPoses>& poses, MisfitOfModel misfit, const RenewMisfit& renew, ThreadPool* pool,
    const std::function<bool(double done)>& progress) {
  std::vector<std::shared_ptr<const Effect>> effects = Catalogue().All();
  effects.insert(effects.end(), also.begin(), also.end());
  std::vector<Direction> directions;
  for (const auto& effect : effects)
    if (Worthwhile(*effect, noise_is_known)) AddDirections(effect, model.fingers, &directions);

  // In portions, so that progress and cancelling stay with this thread.
  const auto in_portions = [&](size_t count, double from, double to, const auto& body) -> absl::Status {
    std::vector<absl::Status> status(count);
    const size_t portion = pool ? pool->size() + 1 : 1;
    for (size_t begin = 0; begin < count; begin += portion) {
      if (progress && !progress(from + (to - from) * begin / count)) return absl::CancelledError("cancelled");
      const size_t end = std::min(count, begin + portion);
      const auto run = [&](int a, int b) {
        for (int n = a; n < b; ++n) status[begin + n] = body(begin + n);
      };
      ParallelFor(pool, static_cast<int>(end - begin), 1, run);
      for (size_t n = begin; n < end; ++n) TOUCHSTONE_RETURN_IF_ERROR(status[n]);
    }
    return absl::OkStatus();
  };
  std::vector<Trial> screened(directions.size());
  TOUCHSTONE_RETURN_IF_ERROR(in_portions(directions.size(), 0, 0.5, [&](size_t d) {
    return Screen(model, directions[d], poses, misfit, &screened[d]);
  }));

  // The best directions of the best effects, closer.
  std::stable_sort(screened.begin(), screened.end(),
                   [](const Trial& a, const Trial& b) { return a.misfit.distance < b.misfit.distance; });
  std::vector<Trial> best;
  for (const Trial& trial : screened) {
    if (best.size() == kRefined || trial.misfit.distance == HUGE_VAL) break;
    const auto alike = std::count_if(best.begin(), best.end(), [&](const Trial& b) {
      return b.direction.effect == trial.direction.effect;
    });
    if (alike < kRefinedOfAnEffect) best.push_back(trial);
  }
  if (best.empty()) return std::vector<CompatibleEffect>();
  const auto judge_anew = [&](double from, double to) {
    return in_portions(best.size(), from, to, [&](size_t n) {
      const Trial start = best[n];
      best[n].misfit = {HUGE_VAL, 0};  // by another measure: not comparable
      return Attempt(model, start, ReferenceSize::kFull, misfit, &best[n]);
    });
  };
  const auto leader = [&] {
    return *std::min_element(best.begin(), best.end(), [](const Trial& a, const Trial& b) {
      return a.misfit.distance < b.misfit.distance;
    });
  };
  TOUCHSTONE_RETURN_IF_ERROR(judge_anew(0.5, 0.55));
  double done = 0.55;
  for (size_t n = 0; n < std::size(kSteps); ++n) {
    const double step = kSteps[n];
    if (n == kStepsBeforeRenewal) {
      const Trial best_so_far = leader();
      TOUCHSTONE_ASSIGN_OR_RETURN(
          misfit, renew(Varied(model, best_so_far.direction, best_so_far.amounts), best_so_far.poses));
      TOUCHSTONE_RETURN_IF_ERROR(judge_anew(done, done + 0.04));
      done += 0.04;
    }
    const SupposedPoses promising = leader().poses;
    TOUCHSTONE_RETURN_IF_ERROR(in_portions(best.size(), done, done + 0.04, [&](size_t n) {
      return Refine(model, step, promising, misfit, &best[n]);
    }));
    done += 0.04;
    // Who is far behind by now does not catch up.
    const double least = leader().misfit.distance;
    best.erase(std::remove_if(best.begin(), best.end(),
                              [&](const Trial& trial) {
                                return trial.misfit.p < kHopelessP && trial.misfit.distance > 2 * least + 2;
                              }),
               best.end());
  }
  std::stable_sort(best.begin(), best.end(),
                   [](const Trial& a, const Trial& b) { return a.misfit.p > b.misfit.p; });
  std::vector<CompatibleEffect> compatible;
  for (const Trial& trial : best) {
    const std::string& name = trial.direction.effect->name;
    if (trial.misfit.p > kCompatibleP &&
        std::none_of(compatible.begin(), compatible.end(),
                     [&](const CompatibleEffect& effect) { return effect.effect == name; }))
      compatible.push_back({name, InWords(model, trial.direction, trial.amounts), trial.misfit.p});
  }
  return compatible;
}

}  // namespace touchstone
