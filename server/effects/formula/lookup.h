// Curves that a model file holds instead of a formula: what depends on a covariate and has no name yet.
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "server/model/effect.h"

namespace touchstone::effects {

inline constexpr int kMaxLookupKnots = 1000;

// Checks a curve. Errors name the lookup and the field. The effect may be applied by any number of threads at once;
// its name is "lookup", its definition is effect->lookup. It has no parameters: a curve is changed as a whole.
absl::StatusOr<std::shared_ptr<const model::Effect>> MakeLookupEffect(const model::LookupSpec& spec);

// The curve of one finger at a value of the covariate: linear between knots, constant beyond the first and the last.
double LookupValue(const model::LookupSpec& spec, int finger, double covariate);

}  // namespace touchstone::effects
