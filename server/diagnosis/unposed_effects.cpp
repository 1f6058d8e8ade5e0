#include "server/diagnosis/unposed_effects.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/status.h"
#include "server/effects/all_effects.h"

namespace touchstone {
namespace {

constexpr double kCompatibleP = 0.1;
constexpr double kStrengths[] = {0.25, 0.5, 1, 2, 4};  // of the typical value

// One number of one effect that is varied.
struct Direction {
  std::shared_ptr<const Effect> effect;
  int parameter = 0, entry = 0;
  int offset = 0;  // of the parameter in the flat values
};

// The model with `amount` (SI) added to one number, or set where the neutral value stands for infinity.
// Null if the value would leave its bounds.
std::shared_ptr<const Model> Varied(const Model& model, const Direction& direction, double amount) {
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
    if (info.neutral == info.upper && info.neutral != 0)
      value[direction.entry] = amount;  // an acceleration, degrees of freedom: less is more
    else
      value[direction.entry] += amount;
    if (info.sum_zero)
      for (int i = 0; i < count; ++i) value[i] -= amount / count;
    for (int i = 0; i < count; ++i)
      if (value[i] < ToSi(info.unit, info.lower) || value[i] > ToSi(info.unit, info.upper)) return false;
    return true;
  };
  if (!vary(&instance->values)) return nullptr;
  for (auto& [object, values] : instance->object_values)
    if (!vary(&values)) return nullptr;
  return varied;
}

std::string InWords(const Model& model, const Direction& direction, double amount) {
  const ParameterInfo& info = direction.effect->parameters[direction.parameter];
  std::string entry;
  if (info.arity == Arity::kVector3) entry = absl::StrCat(" ", std::string(1, "xyz"[direction.entry]));
  if (info.arity == Arity::kPerFinger) entry = absl::StrCat(" of finger ", direction.entry + 1);
  const auto model_has =
      std::any_of(model.effects.begin(), model.effects.end(),
                  [&](const EffectInstance& e) { return e.effect->name == direction.effect->name; });
  return absl::StrCat(info.name, entry, model_has && info.neutral == 0 ? " changed by " : " = ",
                      absl::StrFormat("%.3g", FromSi(info.unit, amount)));
}

// What is missing cannot be seen in complete touches; "formula" alone changes nothing.
bool Worthwhile(const Effect& effect) {
  return effect.name != "missed_contact" && effect.name != "formula" && !effect.parameters.empty() &&
         effect.needs.covariates.empty();
}

// The best strength along one direction.
absl::Status SearchDirection(const Model& model, const Direction& direction, const MisfitOfModel& misfit,
                             CompatibleEffect* best) {
  const ParameterInfo& info = direction.effect->parameters[direction.parameter];
  const double typical =
      ToSi(info.unit, info.typical != 0 ? std::abs(info.typical) : 0.05 * (info.upper - info.lower));
  std::map<double, UnposedMisfit> tried;
  const auto attempt = [&](double amount) -> absl::Status {
    const auto varied = Varied(model, direction, amount);
    if (!varied || tried.count(amount)) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(tried[amount], misfit(varied));
    return absl::OkStatus();
  };
  for (const double strength : kStrengths)
    for (const double sign : {-1.0, 1.0}) TOUCHSTONE_RETURN_IF_ERROR(attempt(sign * strength * typical));
  if (tried.empty()) return absl::OkStatus();
  const auto nearest = [&] {
    return std::min_element(tried.begin(), tried.end(), [](const auto& a, const auto& b) {
      return a.second.distance < b.second.distance;
    });
  };
  // Between the neighbours of the best: an energy distance is about a parabola there.
  for (int n = 0; n < 2; ++n) {
    const auto middle = nearest();
    if (middle == tried.begin() || std::next(middle) == tried.end()) break;
    const double a = std::prev(middle)->first, b = middle->first, c = std::next(middle)->first;
    const double fa = std::prev(middle)->second.distance, fb = middle->second.distance,
                 fc = std::next(middle)->second.distance;
    const double numerator = (b - a) * (b - a) * (fb - fc) - (b - c) * (b - c) * (fb - fa);
    const double denominator = (b - a) * (fb - fc) - (b - c) * (fb - fa);
    if (denominator == 0) break;
    const double vertex = b - 0.5 * numerator / denominator;
    if (!(vertex > a && vertex < c)) break;
    TOUCHSTONE_RETURN_IF_ERROR(attempt(vertex));
  }
  const auto found = nearest();
  if (found->second.p > best->p) {
    best->effect = direction.effect->name;
    best->values = InWords(model, direction, found->first);
    best->p = found->second.p;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<CompatibleEffect>> FindCompatibleEffects(
    const Model& model, const std::vector<std::shared_ptr<const Effect>>& also, const MisfitOfModel& misfit,
    ThreadPool* pool, const std::function<bool(double done)>& progress) {
  std::vector<std::shared_ptr<const Effect>> effects = Catalogue().All();
  effects.insert(effects.end(), also.begin(), also.end());
  effects.erase(
      std::remove_if(effects.begin(), effects.end(), [](const auto& effect) { return !Worthwhile(*effect); }),
      effects.end());

  std::vector<CompatibleEffect> best(effects.size());
  std::vector<absl::Status> status(effects.size());
  const auto search = [&](int begin, int end) {
    for (int e = begin; e < end; ++e) {
      int offset = 0;
      for (size_t p = 0; p < effects[e]->parameters.size() && status[e].ok(); ++p) {
        const ParameterInfo& info = effects[e]->parameters[p];
        const int count = info.Count(model.fingers);
        // The length of bumps and the like are no strength: they say how, not how much.
        if (p == 0 || info.neutral == 0)
          for (int entry = 0; entry < count && status[e].ok(); ++entry)
            status[e] =
                SearchDirection(model, {effects[e], static_cast<int>(p), entry, offset}, misfit, &best[e]);
        offset += count;
      }
    }
  };
  // In portions, so that progress and cancelling stay with this thread.
  const int portion = pool ? 2 * (pool->size() + 1) : 1;
  for (int begin = 0; begin < static_cast<int>(effects.size()); begin += portion) {
    if (progress && !progress(double(begin) / effects.size())) return absl::CancelledError("cancelled");
    const int end = std::min<int>(effects.size(), begin + portion);
    if (pool)
      pool->ParallelFor(end - begin, 1, [&](int from, int to) { search(begin + from, begin + to); });
    else
      search(begin, end);
  }
  std::vector<CompatibleEffect> compatible;
  for (size_t e = 0; e < effects.size(); ++e) {
    TOUCHSTONE_RETURN_IF_ERROR(status[e]);
    if (best[e].p > kCompatibleP) compatible.push_back(best[e]);
  }
  std::stable_sort(compatible.begin(), compatible.end(),
                   [](const CompatibleEffect& a, const CompatibleEffect& b) { return a.p > b.p; });
  return compatible;
}

}  // namespace touchstone
