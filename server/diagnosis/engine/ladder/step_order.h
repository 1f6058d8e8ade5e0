// The order in which the steps of an explanation are shown: each lets the error fall.
#pragma once

#include <functional>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/competition/result.h"

namespace touchstone::diagnosis::engine {

// A step, and the fit with it and all earlier ones.
struct OrderedStep {
  const SelectedStep* step = nullptr;
  Fit fit;
  bool last = false;   // with it, no step is open
  bool whole = false;  // the last, and the fit is the whole explanation
  Quality quality;     // what ErrorOfStep gave
};

// The error after a step. `last`: of the steps before it, for those that need not know an error of unseen parts where
// the error of the fit does not fall; they say infinity.
using ErrorOfStep = std::function<absl::StatusOr<Quality>(const OrderedStep& step, const Quality& last)>;

struct StepOrder {
  std::vector<OrderedStep> steps;
  // The effect of a step to be taken out, -1: none. Then `steps` is empty. The first with which the error does not fall, if
  // it does not after all others either; where it does, and there is no order in which it falls with each, the step that
  // explains least.
  int without_gain = -1;
};

// Whether the error of the fit, and that on parts that it did not see, falls with the step: otherwise it is none. With one that is
// rather none by its probability, the second must fall by as much as a search asks of a step.
bool Falls(const Quality& before, const Quality& after, const SelectedStep& step);

// The steps in the order in which they explain most, as far as the error falls with each: a step may need one that explains
// less by itself, as a tip's radius may need the right spacing of the fingers. Each is fitted with those before it; the last
// one's fit is the whole explanation, unless that holds an effect without a name (index `nameless`; -1: none). `before`:
// of the given model. `steps` must outlive the result. Errors as FitModel and as `error_of`.
absl::StatusOr<StepOrder> OrderSteps(const Experiment& experiment, const Explanation& whole, int nameless,
                                     const std::vector<SelectedStep>& steps, const Quality& before,
                                     const ErrorOfStep& error_of);

}  // namespace touchstone::diagnosis::engine
