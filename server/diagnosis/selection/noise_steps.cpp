// The kind of noise, as steps where the model has none of it, as refits where its values are others.
#include <algorithm>
#include <cmath>

#include "server/base/normal.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/ladder.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kSignificant = 3.3;   // standard errors, for a refit
constexpr double kRelevant = 0.02;     // relative change, for a refit
constexpr double kMinSigmaS = 1.5e-6;  // less is the rounding of the file
constexpr double kMinFloorUs = 2;      // of noise as a step: less is the rounding of the file
constexpr double kCertainNats = 1e3;   // noise is there or not: any scatter beyond rounding proves it

class NoiseStepWriter {
 public:
  explicit NoiseStepWriter(Ladder* ladder) : ladder_(*ladder) {}

  // The effect of this role, which has one parameter.
  void Write(model::EffectRole role, const inference::NoiseEstimate& found) {
    model::EffectInstance* present = nullptr;
    for (model::EffectInstance& instance : ladder_.improved.effects)
      if (instance.effect->role == role) present = &instance;
    const auto effect = effects::FindByRole(role);
    const inference::ParameterEstimate estimate = Estimate(effect->parameters[0], found);
    if (present != nullptr)
      Refit(estimate, present);
    else
      Add(effect, estimate, found.gain_nats);
  }

  // The wander has two parameters; a model that has it keeps values that are not clearly others.
  void WriteMemory(const NoiseMemory& memory) {
    const auto effect = effects::FindByRole(model::EffectRole::kNoiseMemory);
    const std::vector<inference::ParameterEstimate> estimates = {
        Estimate(effect->parameters[0], memory.sigma_s), Estimate(effect->parameters[1], memory.time_s)};
    for (model::EffectInstance& instance : ladder_.improved.effects) {
      if (instance.effect->role != model::EffectRole::kNoiseMemory) continue;
      RefitMemory(estimates, &instance);
      return;
    }
    Add(effect, estimates[0], memory.gain_nats);
    ladder_.steps.back().parameters = estimates;
    ladder_.improved.effects.back().values[1] =
        ToSi(effect->parameters[1].unit, RoundedTo(estimates[1].value, estimates[1].std_error));
  }

 private:
  void RefitMemory(std::vector<inference::ParameterEstimate> estimates, model::EffectInstance* present) {
    bool other = false;
    for (size_t p = 0; p < estimates.size(); ++p) {
      const double before = FromSi(present->effect->parameters[p].unit, present->values[p]);
      estimates[p].before = before;
      other |= std::abs(estimates[p].value - before) > kSignificant * estimates[p].std_error;
    }
    if (!other) return;
    for (size_t p = 0; p < estimates.size(); ++p)
      present->values[p] =
          ToSi(present->effect->parameters[p].unit, RoundedTo(estimates[p].value, estimates[p].std_error));
    ladder_.refitted.push_back({present->effect->name, std::move(estimates)});
    ladder_.changed = true;
  }

  static inference::ParameterEstimate Estimate(const model::ParameterInfo& parameter,
                                               const inference::NoiseEstimate& found) {
    inference::ParameterEstimate estimate;
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
                             const inference::ParameterEstimate& estimate) {
    const double rounded = RoundedTo(estimate.value, estimate.std_error);
    return ToSi(parameter.unit, std::clamp(rounded, parameter.lower, parameter.upper));
  }

  void Refit(inference::ParameterEstimate estimate, model::EffectInstance* present) {
    const Unit unit = present->effect->parameters[0].unit;
    const double before = FromSi(unit, present->values[0]), change = std::abs(estimate.value - before);
    if (change < kSignificant * estimate.std_error || change < kRelevant * estimate.value) return;
    estimate.before = before;
    present->values[0] = RoundedValue(present->effect->parameters[0], estimate);
    present->object_values.clear();
    ladder_.refitted.push_back({present->effect->name, {std::move(estimate)}});
    ladder_.changed = true;
  }

  void Add(const std::shared_ptr<const model::Effect>& effect, const inference::ParameterEstimate& estimate,
           double gain_nats) {
    LadderStep step;
    step.effect = effect->name;
    step.meaning = effect->meaning;
    step.check_on_rig = effect->check_on_rig;
    step.remedy = effect->remedy;
    step.gain_nats = gain_nats;
    step.probability = ProbabilityOf(gain_nats);
    step.parameters = {estimate};
    step.quality = ladder_.final;  // noise changes no expectation: the errors stay
    ladder_.steps.push_back(std::move(step));
    model::EffectInstance instance;
    instance.effect = effect;
    instance.values = effect->NeutralValues(ladder_.improved.fingers);
    instance.values[0] = RoundedValue(effect->parameters[0], estimate);
    ladder_.improved.effects.push_back(std::move(instance));
    ladder_.changed = true;
  }

  Ladder& ladder_;
};

}  // namespace

void AddMemoryStep(const NoiseMemory& memory, Ladder* ladder) {
  NoiseStepWriter(ladder).WriteMemory(memory);
}

void AddNoiseSteps(const inference::NoiseFindings& noise, Ladder* ladder) {
  NoiseStepWriter writer(ladder);
  const bool has_sigma = std::any_of(
      ladder->improved.effects.begin(), ladder->improved.effects.end(),
      [](const model::EffectInstance& e) { return e.effect->role == model::EffectRole::kNoiseLevel; });
  inference::NoiseEstimate sigma = noise.sigma_s;
  sigma.gain_nats = kCertainNats;
  // Where ticks explain the scatter there is no further noise to be seen.
  const bool scatter = sigma.value > kMinSigmaS;
  if (scatter && (has_sigma || ladder->noise_floor.sigma_s * kMicrosecondsPerSecond > kMinFloorUs))
    writer.Write(model::EffectRole::kNoiseLevel, sigma);
  const std::pair<model::EffectRole, const inference::NoiseEstimate*> kinds[] = {
      {model::EffectRole::kNoiseGrowth, &noise.slope},
      {model::EffectRole::kNoiseTails, &noise.degrees_of_freedom},
      {model::EffectRole::kQuantisation, &noise.poll_interval_s},
      {model::EffectRole::kDropout, &noise.missed_probability},
  };
  for (const auto& [role, found] : kinds)
    if (found->gain_nats > 0) writer.Write(role, *found);
}

}  // namespace touchstone::diagnosis::selection
