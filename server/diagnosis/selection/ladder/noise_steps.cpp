// The kind of noise, as steps where the model has none of it, as refits where its values are others.
#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/numbers/normal.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/ladder/rules.h"
#include "server/diagnosis/selection/scatter/declared_noise.h"
#include "server/diagnosis/selection/session/time_structure.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

class NoiseStepWriter {
 public:
  explicit NoiseStepWriter(Ladder* ladder) : ladder_(*ladder) {}

  // The effect of this role, which has one parameter.
  void Write(model::EffectRole role, const touches::NoiseEstimate& found) {
    model::EffectInstance* present = nullptr;
    for (model::EffectInstance& instance : ladder_.improved.effects)
      if (instance.effect->role == role) present = &instance;
    const auto effect = effects::FindByRole(role);
    const engine::ParameterEstimate estimate = Estimate(effect->parameters[0], found);
    if (present != nullptr)
      Refit(estimate, present);
    else
      Add(effect, estimate, found.gain_nats);
  }

  // The effect of this role is one that the data do without.
  void Remove(model::EffectRole role) {
    std::vector<model::EffectInstance>& effects = ladder_.improved.effects;
    for (size_t index = effects.size(); index-- > 0;) {
      if (effects[index].effect->role != role) continue;
      ladder_.superfluous.push_back(effects[index].effect->name);
      effects.erase(effects.begin() + static_cast<long>(index));
      ladder_.values_wrong = ladder_.changed = true;
    }
  }

  void WriteOrRemove(model::EffectRole role, const touches::NoiseEstimate& found) {
    if (found.absent)
      Remove(role);
    else if (found.gain_nats > 0)
      Write(role, found);
  }

  // What the fingers' noise has beyond the quietest finger's.
  void WriteByFinger(const std::vector<touches::NoiseEstimate>& found) {
    const auto effect = effects::FindByRole(model::EffectRole::kNoiseByFinger);
    const model::ParameterInfo& parameter = effect->parameters[0];
    std::vector<engine::ParameterEstimate> estimates;
    std::vector<double> values;
    for (const touches::NoiseEstimate& finger : found) {
      estimates.push_back(Estimate(parameter, finger));
      estimates.back().entry = model::FingerName(static_cast<int>(values.size()), ladder_.improved.fingers);
      values.push_back(RoundedValue(parameter, estimates.back()));
    }
    for (model::EffectInstance& instance : ladder_.improved.effects) {
      if (instance.effect->role != model::EffectRole::kNoiseByFinger) continue;
      RefitAll(std::move(estimates), &instance);
      return;
    }
    Add(effect, estimates[0], found[0].gain_nats);
    ladder_.steps.back().parameters = std::move(estimates);
    ladder_.improved.effects.back().values = std::move(values);
  }

  // Correlated noise has two parameters; a model that has it keeps values that are not clearly others.
  void WriteMemory(const NoiseMemory& memory) {
    const auto effect = effects::FindByRole(model::EffectRole::kNoiseMemory);
    const std::vector<engine::ParameterEstimate> estimates = {Estimate(effect->parameters[0], memory.sigma_s),
                                                              Estimate(effect->parameters[1], memory.time_s)};
    for (model::EffectInstance& instance : ladder_.improved.effects) {
      if (instance.effect->role != model::EffectRole::kNoiseMemory) continue;
      RefitAll(estimates, &instance);
      return;
    }
    Add(effect, estimates[0], memory.gain_nats);
    ladder_.steps.back().parameters = estimates;
    ladder_.improved.effects.back().values[1] =
        ToSi(effect->parameters[1].unit, engine::RoundedTo(estimates[1].value, estimates[1].std_error));
  }

 private:
  // All values of an effect, one estimate each: new ones if any is clearly another.
  void RefitAll(std::vector<engine::ParameterEstimate> estimates, model::EffectInstance* present) {
    const std::vector<model::ParameterInfo>& parameters = present->effect->parameters;
    bool other = false;
    for (size_t p = 0; p < estimates.size(); ++p) {
      const double before = FromSi(parameters[std::min(p, parameters.size() - 1)].unit, present->values[p]);
      estimates[p].before = before;
      other |= std::abs(estimates[p].value - before) > kLadderRules.significant * estimates[p].std_error;
    }
    if (!other) return;
    for (size_t p = 0; p < estimates.size(); ++p)
      present->values[p] = RoundedValue(parameters[std::min(p, parameters.size() - 1)], estimates[p]);
    present->object_values.clear();
    ladder_.refitted.push_back({present->effect->name, std::move(estimates)});
    ladder_.changed = true;
  }

  static engine::ParameterEstimate Estimate(const model::ParameterInfo& parameter,
                                            const touches::NoiseEstimate& found) {
    engine::ParameterEstimate estimate;
    estimate.name = parameter.name;
    estimate.unit = std::string(UnitSymbol(parameter.unit));
    estimate.value = FromSi(parameter.unit, std::clamp(found.value, ToSi(parameter.unit, parameter.lower),
                                                       ToSi(parameter.unit, parameter.upper)));
    estimate.std_error = FromSi(parameter.unit, found.std_error);
    estimate.lower = std::max(parameter.lower, estimate.value - kNormalQuantile975 * estimate.std_error);
    estimate.upper = std::min(parameter.upper, estimate.value + kNormalQuantile975 * estimate.std_error);
    return estimate;
  }

  // SI. Rounding must not push a value over its bound: no model file may hold it.
  static double RoundedValue(const model::ParameterInfo& parameter,
                             const engine::ParameterEstimate& estimate) {
    const double rounded = engine::RoundedTo(estimate.value, estimate.std_error);
    return ToSi(parameter.unit, std::clamp(rounded, parameter.lower, parameter.upper));
  }

  void Refit(engine::ParameterEstimate estimate, model::EffectInstance* present) {
    const Unit unit = present->effect->parameters[0].unit;
    const double before = FromSi(unit, present->values[0]), change = std::abs(estimate.value - before);
    if (change < kLadderRules.significant * estimate.std_error ||
        change < kLadderRules.relevant * estimate.value)
      return;
    estimate.before = before;
    present->values[0] = RoundedValue(present->effect->parameters[0], estimate);
    present->object_values.clear();
    ladder_.refitted.push_back({present->effect->name, {std::move(estimate)}});
    ladder_.changed = true;
  }

  void Add(const std::shared_ptr<const model::Effect>& effect, const engine::ParameterEstimate& estimate,
           double gain_nats) {
    std::vector<double> values = effect->NeutralValues(ladder_.improved.fingers);
    values[0] = RoundedValue(effect->parameters[0], estimate);
    engine::LadderStep& step = engine::AddNoiseStep(
        effect, std::move(values), {estimate}, engine::ProbabilityOf(gain_nats), ladder_.final, &ladder_);
    step.gain_nats = gain_nats;
    if (effect->role == model::EffectRole::kDropout) step.words = std::exchange(ladder_.dropouts, "");
  }

  Ladder& ladder_;
};

}  // namespace

void AddMemoryStep(const NoiseMemory& memory, const touches::Observations& observations, Ladder* ladder) {
  const model::EffectInstance* declared = DeclaredMemoryOf(ladder->improved);
  if (declared != nullptr &&
      !AssessDeclaredMemory(observations, ladder->residuals, declared->values[0], declared->values[1]).other)
    return;
  NoiseStepWriter(ladder).WriteMemory(memory);
}

void RemoveAbsentMemory(const touches::Observations& observations, Ladder* ladder) {
  const model::EffectInstance* declared = DeclaredMemoryOf(ladder->improved);
  if (declared != nullptr &&
      AssessDeclaredMemory(observations, ladder->residuals, declared->values[0], declared->values[1]).absent)
    NoiseStepWriter(ladder).Remove(model::EffectRole::kNoiseMemory);
}

namespace {

// The noise of one reading. Where repeats say how much they scatter, what a misfit adds to the residuals is no noise,
// and neither is a course in time that repeats share.
// `in_time`: kinds of noise that were found beside the level are left out, and it is no level by itself.
touches::NoiseEstimate SigmaOf(const touches::NoiseFindings& noise, const engine::NoiseFloor& floor,
                               bool in_time) {
  touches::NoiseEstimate sigma = noise.sigma_s;
  sigma.gain_nats = kLadderRules.certain;
  const bool plain = noise.slope.gain_nats == 0 && noise.degrees_of_freedom.gain_nats == 0 &&
                     noise.poll_interval_s.gain_nats == 0 && noise.length_sigma_m.gain_nats == 0 &&
                     noise.channel_sigma_s.empty();
  if (!plain || !floor.from_repeats) return sigma;
  const double floor_s = SharesTime(floor) ? floor.sigma_without_time : floor.sigma;
  if (!in_time && sigma.value <= floor_s + (floor.upper - floor.sigma)) return sigma;
  sigma.value = floor_s;
  sigma.std_error = floor_s / std::sqrt(2 * floor.degrees_of_freedom);
  return sigma;
}

}  // namespace

void AddNoiseSteps(touches::NoiseFindings noise, bool correlated, Ladder* ladder) {
  NoiseStepWriter writer(ladder);
  const bool in_time = correlated || SharesTime(ladder->noise_floor);
  if (in_time) {
    noise.slope = noise.degrees_of_freedom = noise.length_sigma_m = {};
    noise.channel_sigma_s.clear();
    noise.channels_absent = false;
  }
  const model::Model given = ladder->improved;
  const bool has_sigma = std::any_of(
      given.effects.begin(), given.effects.end(),
      [](const model::EffectInstance& e) { return e.effect->role == model::EffectRole::kNoiseLevel; });
  const touches::NoiseEstimate sigma = SigmaOf(noise, ladder->noise_floor, in_time);
  // Where ticks explain the scatter there is no further noise to be seen.
  const bool scatter = sigma.value > kLadderRules.min_sigma;
  // The level that a model has beside kinds of noise that are not assessed here says nothing by itself.
  const touches::DeclaredNoise declared = DeclaredNoiseOf(given);
  const bool level_alone = !declared.slope && !declared.degrees_of_freedom && !declared.length_sigma_m &&
                           declared.channel_sigma_s.empty();
  const bool assessed = level_alone || !(in_time || noise.shape_hidden);
  if (assessed && sigma.absent)
    writer.Remove(model::EffectRole::kNoiseLevel);
  else if (assessed && scatter &&
           (has_sigma || ladder->noise_floor.sigma * kMicrosecondsPerSecond > kLadderRules.min_floor))
    writer.Write(model::EffectRole::kNoiseLevel, sigma);
  writer.WriteOrRemove(model::EffectRole::kNoiseGrowth, noise.slope);
  writer.WriteOrRemove(model::EffectRole::kNoiseTails, noise.degrees_of_freedom);
  writer.WriteOrRemove(model::EffectRole::kQuantisation, noise.poll_interval_s);
  writer.WriteOrRemove(model::EffectRole::kDropout, noise.missed_probability);
  writer.WriteOrRemove(model::EffectRole::kNoiseOfLength, noise.length_sigma_m);
  if (noise.channels_absent) writer.Remove(model::EffectRole::kNoiseByFinger);
  if (!noise.channel_sigma_s.empty()) writer.WriteByFinger(noise.channel_sigma_s);
  // Sigma is estimated anew by every diagnosis; a declared one that is off by a factor is a wrong value.
  const double declared_s = DeclaredSigma(given);
  if (declared_s > 0 && scatter &&
      std::abs(std::log(sigma.value / declared_s)) > std::log(kLadderRules.sigma_factor.value()))
    ladder->values_wrong = true;
}

}  // namespace touchstone::diagnosis::selection
