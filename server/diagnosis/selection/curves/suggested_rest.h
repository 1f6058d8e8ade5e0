// What stands for a rest without a name in the fit, a curve or a formula, after the explanation around it has changed.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// The curve that explains the rest, after effects beside which it was fitted have left: fitted to what the others leave,
// or gone. Nothing where there is none.
absl::Status FitCurveAnew(const Workspace& workspace, SelectionResult* result);

// Puts the simple term that comes nearest to the curve in the curve's place in `result`, fitted with everything else.
// False, and nothing is changed: the rest's effect is no curve, or no term comes near it.
absl::StatusOr<bool> UseNearestFormula(const Workspace& workspace, SelectionResult* result);

// The term of the curve's covariate that gains most, if that is a good part of what the curve gains; null: none.
const FormulaTerm* NearestTerm(const std::vector<FormulaTerm>& terms, const NamelessCurve& curve);

}  // namespace touchstone::diagnosis::selection
