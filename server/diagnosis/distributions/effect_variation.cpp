#include "server/diagnosis/distributions/effect_variation.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace touchstone::diagnosis::distributions {

std::shared_ptr<const model::Model> Varied(const model::Model& model, const EffectDirection& direction,
                                           const std::vector<double>& amounts) {
  auto varied = std::make_shared<model::Model>(model);
  model::EffectInstance* instance = nullptr;
  for (model::EffectInstance& candidate : varied->effects)
    if (candidate.effect->name == direction.effect->name && !direction.effect->formula) instance = &candidate;
  if (!instance) {
    model::EffectInstance added;
    added.effect = direction.effect;
    added.per_object = direction.effect->always_per_object;
    added.values = direction.effect->NeutralValues(model.fingers);
    // The other parameters of the effect (the length of a bump) at their typical size.
    int offset = 0;
    for (size_t p = 0; p < direction.effect->parameters.size(); ++p) {
      const model::ParameterInfo& info = direction.effect->parameters[p];
      if (info.arity == model::Arity::kScalar && static_cast<int>(p) != direction.parameter &&
          info.typical != 0 && info.neutral != 0)
        added.values[offset] = ToSi(info.unit, info.typical);
      offset += info.Count(model.fingers);
    }
    varied->effects.push_back(std::move(added));
    instance = &varied->effects.back();
  }
  const model::ParameterInfo& info = direction.effect->parameters[direction.parameter];
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

std::string VariationInWords(const model::Model& model, const EffectDirection& direction,
                             const std::vector<double>& amounts) {
  const model::ParameterInfo& info = direction.effect->parameters[direction.parameter];
  double mean = 0;
  if (info.sum_zero)
    for (const double amount : amounts) mean += amount / amounts.size();
  std::vector<std::string> values;
  for (const double amount : amounts)
    values.push_back(absl::StrFormat("%.3g", FromSi(info.unit, amount - mean)));
  const auto model_has =
      std::any_of(model.effects.begin(), model.effects.end(),
                  [&](const model::EffectInstance& e) { return e.effect->name == direction.effect->name; });
  return absl::StrCat(info.name, model_has && info.neutral == 0 ? " changed by " : " = ",
                      values.size() == 1 ? values[0] : absl::StrCat("[", absl::StrJoin(values, ", "), "]"));
}

bool VisibleWithoutPoses(const model::Effect& effect, bool noise_is_known) {
  const bool noise =
      effect.role == model::EffectRole::kNoiseLevel || effect.role == model::EffectRole::kNoiseGrowth ||
      effect.role == model::EffectRole::kNoiseOfLength || effect.role == model::EffectRole::kNoiseByFinger ||
      effect.role == model::EffectRole::kNoiseTails;
  if (effect.role == model::EffectRole::kDropout || effect.role == model::EffectRole::kNoiseMemory ||
      (noise && noise_is_known))
    return false;
  return !effect.parameters.empty() && effect.needs.covariates.empty();
}

std::vector<EffectDirection> DirectionsOf(const std::shared_ptr<const model::Effect>& effect, int fingers) {
  std::vector<EffectDirection> directions;
  int offset = 0;
  for (size_t p = 0; p < effect->parameters.size(); ++p) {
    const model::ParameterInfo& info = effect->parameters[p];
    const int count = info.Count(fingers);
    // Others (the length of bumps) describe the shape of the effect, not its strength.
    if (p == 0 || info.neutral == 0)
      for (int entry = 0; entry < count; ++entry)
        directions.push_back({effect, static_cast<int>(p), entry, offset});
    offset += count;
  }
  return directions;
}

}  // namespace touchstone::diagnosis::distributions
