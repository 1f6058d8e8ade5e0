// Fitted values without digits that mean nothing.
#include <cmath>

#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/model/parameter_values.h"

namespace touchstone::diagnosis::engine {
namespace {

// Sets the entry of `parameter` that the estimate is of. `values`: of its whole effect.
void SetRounded(const ParameterEstimate& estimate, const model::ParameterInfo& parameter, int offset,
                int fingers, std::vector<double>* values) {
  const int last = parameter.Count(fingers) - 1;
  for (int j = 0; j <= last; ++j) {
    if (EntryName(parameter, j, fingers) != estimate.entry) continue;
    const double rounded = RoundedTo(estimate.value, estimate.std_error);
    if (rounded >= parameter.lower && rounded <= parameter.upper)
      (*values)[offset + j] = ToSi(parameter.unit, rounded);
    // The last of values that sum to zero is what the others leave.
    if (!parameter.sum_zero || j != last) continue;
    double sum = 0;
    for (int i = 0; i < last; ++i) sum += (*values)[offset + i];
    (*values)[offset + last] = -sum;
  }
}

}  // namespace

double RoundedTo(double value, double std_error) {
  if (!(std_error > 0) || !std::isfinite(std_error) || value == 0) return value;
  const double digit = std::pow(10.0, std::floor(std::log10(std_error)) - 2);
  // A power of ten is exact upwards only.
  return digit >= 1 ? std::round(value / digit) * digit : std::round(value / digit) / std::round(1 / digit);
}

void RoundValues(const Fit& fit, model::Model* model) {
  for (int index = 0; index < static_cast<int>(model->effects.size()); ++index) {
    if (!fit.model.IsFree(index)) continue;
    model::EffectInstance& instance = model->effects[index];
    const model::Effect& effect = *instance.effect;
    for (const ParameterEstimate& estimate : fit.model.Describe(index, fit.point, fit.covariance)) {
      std::vector<double>& values =
          estimate.object.empty() ? instance.values : instance.object_values.at(estimate.object);
      for (int p = 0; p < static_cast<int>(effect.parameters.size()); ++p)
        if (effect.parameters[p].name == estimate.name)
          SetRounded(estimate, effect.parameters[p], model::ValueOffset(effect, p, model->fingers),
                     model->fingers, &values);
    }
  }
}

}  // namespace touchstone::diagnosis::engine
