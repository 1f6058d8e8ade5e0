#include "server/diagnosis/engine/fit/fitted_values.h"

#include <algorithm>

namespace touchstone::diagnosis::engine {

std::vector<int> ValuesOfModel(const Parameterization& fitted, const model::Model& of) {
  std::vector<int> values;
  for (int i = 0; i < fitted.size(); ++i) {
    const auto& effect = fitted.base().effects[fitted.parameters()[i].effect].effect;
    if (std::any_of(of.effects.begin(), of.effects.end(),
                    [&effect](const model::EffectInstance& one) { return one.effect == effect; }))
      values.push_back(i);
  }
  return values;
}

uncertainty::FittedValues FittedValuesOf(const Parameterization& fitted, const std::vector<int>& values,
                                         const Eigen::MatrixXd& covariance) {
  uncertainty::FittedValues of;
  of.covariance = covariance(values, values);
  for (const int value : values) {
    const std::string name = NameOf(*fitted.base().effects[fitted.parameters()[value].effect].effect);
    const auto known = std::find(of.effects.begin(), of.effects.end(), name);
    of.effect_of_value.push_back(static_cast<int>(known - of.effects.begin()));
    if (known == of.effects.end()) of.effects.push_back(name);
  }
  return of;
}

}  // namespace touchstone::diagnosis::engine
