// Every candidate as the only cause.
#pragma once

#include <functional>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

// Each candidate that has a name as the first step from `initial`, a fit of the given model, best first; those that these
// data cannot see, or that fit best where they change nothing, last, with a note. Probabilities share 1 with "nothing is
// missing" and with what has no name. `set_errors` sets the errors of a candidate that was fitted. Errors as FitModel and
// as `set_errors`.
absl::StatusOr<std::vector<RankedCandidate>> RankCandidates(
    const StepwiseSearch& search, const Fit& initial, int initial_effects,
    const std::function<absl::Status(const Fit&, RankedCandidate*)>& set_errors);

}  // namespace touchstone::diagnosis::engine
