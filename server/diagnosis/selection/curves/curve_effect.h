// The lookup of a curve that has no name, as an effect of a model.
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "server/diagnosis/selection/curves/nameless_curve.h"
#include "server/model/effect.h"

namespace touchstone::diagnosis::selection {

// With values that a person can read.
absl::StatusOr<std::shared_ptr<const model::Effect>> MakeCurveEffect(const NamelessCurve& curve);

}  // namespace touchstone::diagnosis::selection
