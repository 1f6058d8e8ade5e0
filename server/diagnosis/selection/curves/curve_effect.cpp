#include "server/diagnosis/selection/curves/curve_effect.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/selection/curves/formula_terms.h"
#include "server/effects/formula/lookup.h"

namespace touchstone::diagnosis::selection {
namespace {

// To a multiple of a power of ten; such a power is exact upwards only.
double RoundedToDigits(double value, double unit) {
  return unit >= 1 ? std::round(value / unit) * unit : std::round(value / unit) / std::round(1 / unit);
}

}  // namespace

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeCurveEffect(const NamelessCurve& curve) {
  model::LookupSpec spec;
  spec.name = NameOfRest(curve.covariate);
  spec.adds_time = curve.adds_time;
  spec.stage = curve.adds_time ? model::Stage::kSensor : model::Stage::kMotion;
  spec.covariate = curve.covariate;
  const double range = curve.knots.back() - curve.knots.front();
  const double knot_unit = std::pow(10.0, std::floor(std::log10(std::max(range, 1e-12))) - 5);
  for (const double knot : curve.knots) spec.knots.push_back(RoundedToDigits(knot, knot_unit));
  const double value_unit = curve.adds_time ? 0.1 : 1e-5;  // us; mm
  for (const std::vector<double>& values : curve.values) {
    spec.values.emplace_back();
    for (const double value : values) spec.values.back().push_back(RoundedToDigits(value, value_unit));
  }
  return effects::MakeLookupEffect(spec);
}

}  // namespace touchstone::diagnosis::selection
