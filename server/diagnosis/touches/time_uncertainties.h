// Standard uncertainties of what a fitted model predicts for the touches of a set or a plan.
#pragma once

#include <vector>

#include "server/diagnosis/touches/predictor.h"
#include "server/uncertainty/budget.h"

namespace touchstone::diagnosis::touches {

struct SetUncertainty {
  std::vector<uncertainty::Budget> budgets;  // by object, then of all; repeats of a pose count once
  // [k * fingers + finger] of the first touch of every pose; NaN and 0 elsewhere.
  std::vector<double> combined_s;
  std::vector<char> beyond_measured;
};

// `prediction`: of the posterior's model, with details (for what a touch feels of the one before it). Poses
// whose first touch is left out of the fits are left out here.
absl::StatusOr<SetUncertainty> UncertaintyOf(const Predictor& predictor, const Prediction& prediction,
                                             const uncertainty::PredictedTimes& times);

}  // namespace touchstone::diagnosis::touches
