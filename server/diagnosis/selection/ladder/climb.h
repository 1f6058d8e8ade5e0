// From a selected explanation to the improved model and the steps that lead to it, with the error after each.
#pragma once

#include <optional>
#include <vector>

#include "server/diagnosis/engine/fit/rules.h"
#include "server/diagnosis/selection/ladder/ladder.h"

namespace touchstone::diagnosis::selection {

struct Climb {
  const engine::Fit* searched = nullptr;  // what is saved: without the formula, on the touches of the search
  engine::Fit fit;                        // the same on all touches
  std::vector<engine::SelectedStep> steps;   // by the effects' indices in these fits
  std::optional<model::Model> with_formula;  // the improved model with it; none where the error does not fall
  std::vector<double>
      residuals_with_rest;  // [k * fingers + i] of that; without a formula of the improved model
  engine::Quality before;   // of the model as it was given
  // Improved model, steps with errors, refits, residuals, noise floor, dropouts.
  Ladder ladder;
  int without_gain = -1;  // engine::StepOrder's, by its index in these fits
};

// `selection` must outlive the result.
absl::StatusOr<Climb> ClimbSteps(const Workspace& workspace, const SelectionResult& selection);

// The fit on every touch, where the search saw a part of them and no surface error stands in the way.
absl::StatusOr<engine::Fit> FitAll(const Workspace& workspace, const engine::Fit& fit,
                                   int max_iterations = engine::kFitRules.max_iterations);

}  // namespace touchstone::diagnosis::selection
