#include "server/diagnosis/selection/scatter/declared_noise.h"

#include <cmath>

namespace touchstone::diagnosis::selection {

using model::EffectRole;

touches::DeclaredNoise DeclaredNoiseOf(const model::Model& model) {
  touches::DeclaredNoise declared;
  for (const model::EffectInstance& instance : model.effects) {
    if (!instance.object_values.empty() || instance.values.empty()) continue;
    const double value = instance.values[0];
    // A value that changes nothing declares nothing.
    if (instance.values == instance.effect->NeutralValues(model.fingers)) continue;
    switch (instance.effect->role) {
      case EffectRole::kNoiseLevel:
        declared.sigma_s = std::hypot(declared.sigma_s, value);
        break;
      case EffectRole::kNoiseGrowth:
        declared.slope = value;
        break;
      case EffectRole::kNoiseTails:
        declared.degrees_of_freedom = value;
        break;
      case EffectRole::kQuantisation:
        declared.poll_interval_s = value;
        break;
      case EffectRole::kDropout:
        declared.missed_probability = value;
        break;
      case EffectRole::kNoiseOfLength:
        declared.length_sigma_m = value;
        break;
      case EffectRole::kNoiseByFinger:
        declared.channel_sigma_s = instance.values;
        break;
      case EffectRole::kPixelNoise:
      case EffectRole::kSystematic:
      case EffectRole::kNoiseMemory:
      case EffectRole::kSmoothError:
        break;
    }
  }
  return declared;
}

double DeclaredSigma(const model::Model& model) {
  const touches::DeclaredNoise declared = DeclaredNoiseOf(model);
  const bool plain = !declared.slope && !declared.degrees_of_freedom && !declared.poll_interval_s &&
                     !declared.length_sigma_m && declared.channel_sigma_s.empty();
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->role == EffectRole::kNoiseMemory ||
        (instance.effect->random() && !instance.object_values.empty()))
      return 0;
  return plain ? declared.sigma_s : 0;
}

const model::EffectInstance* DeclaredMemoryOf(const model::Model& model) {
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->role == EffectRole::kNoiseMemory && instance.object_values.empty()) return &instance;
  return nullptr;
}

}  // namespace touchstone::diagnosis::selection
