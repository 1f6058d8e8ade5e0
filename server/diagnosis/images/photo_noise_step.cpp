// The noise of the pixels, as an effect of the model.
#include <algorithm>
#include <cmath>

#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/images/photo_ladder.h"
#include "server/diagnosis/images/rules.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kRounding = 1.0 / 12;  // variance of rounding to 8 bits

engine::ParameterEstimate Estimate(const model::ParameterInfo& parameter, double value, double error) {
  engine::ParameterEstimate estimate;
  estimate.name = parameter.name;
  estimate.unit = std::string(UnitSymbol(parameter.unit));
  estimate.value = value;
  estimate.std_error = error;
  estimate.lower = std::max(value - 1.96 * error, parameter.lower);
  estimate.upper = std::min(value + 1.96 * error, parameter.upper);
  return estimate;
}

}  // namespace

void AddPixelNoise(const PixelNoise& found, int channels, const engine::Quality& quality,
                   engine::Improvement* improvement) {
  const std::shared_ptr<const model::Effect> effect = effects::FindByRole(model::EffectRole::kPixelNoise);
  const double sigma =
      std::sqrt(std::max(found.sigma_grey * found.sigma_grey - kRounding / std::max(channels, 1), 0.0));
  const bool grows = found.gain > kImageRules.seen_errors * found.gain_error;
  const double gain = grows ? found.gain : 0;
  const double error = sigma > 0 ? found.sigma_error * found.sigma_grey / sigma : found.sigma_error;
  std::vector<engine::ParameterEstimate> parameters = {
      Estimate(effect->parameters[0], sigma, error), Estimate(effect->parameters[1], gain, found.gain_error)};
  std::vector<model::EffectInstance>& effects = improvement->improved.effects;
  const auto own = std::find_if(effects.begin(), effects.end(), [&](const model::EffectInstance& instance) {
    return instance.effect->name == effect->name;
  });
  if (own == effects.end()) {
    if (sigma < kImageRules.min_sigma_grey && gain == 0) return;
    engine::LadderStep& step =
        engine::AddNoiseStep(effect, {sigma, gain}, std::move(parameters),
                             engine::kCompetitionRules.max_probability, quality, improvement);
    step.model = improvement->improved;
    return;
  }
  const double at_middle = kImageRules.noise_at_grey;
  const double before = std::sqrt(own->values[0] * own->values[0] + own->values[1] * at_middle);
  const double after = std::sqrt(sigma * sigma + gain * at_middle);
  if (std::abs(after - before) <
      std::max(kImageRules.seen_share * before, kImageRules.seen_errors * found.sigma_error))
    return;
  parameters[0].before = own->values[0];
  parameters[1].before = own->values[1];
  improvement->refitted.push_back({effect->name, parameters});
  own->values = {sigma, gain};
  improvement->changed = true;
}

}  // namespace touchstone::diagnosis::images
