// What effects would explain of which the slope where they change nothing says nothing: looked for on a grid of sizes.
#pragma once

#include <vector>

#include <absl/status/status.h>

#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

// Sets acts_at of scored extensions of `fit` that show nothing near the start, or whose response is declared to be smooth in the
// inverse of a value only; and their evidence, if it is more than near the start. One simulation a size. Of effects that act
// on all objects alike. Error: CANCELLED, or what the simulator says.
absl::Status ScoreOnGrid(const Experiment& experiment, const Fit& fit, std::vector<Extension>* extensions);

}  // namespace touchstone::diagnosis::engine
