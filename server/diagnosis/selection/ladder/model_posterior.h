// What the fit of the improved model leaves open: the joint covariance of all of its values, and what is no
// value.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/selection/ladder/ladder.h"

namespace touchstone::diagnosis::selection {

// The fit's model with every systematic effect of the improved model free, and without effects that this does
// not have; nothing if the fit's is so already. A value that the search has left as it was given is open too:
// its data say how far.
std::optional<engine::Parameterization> WithEverythingFree(const engine::Fit& fit,
                                                           const model::Model& improved);

// `open`: a fit of such a model, whose covariance is taken; `searched`: the one that the search ended with,
// whose columns tell how large an error of the surfaces is left. Beside the data a value knows the size that
// rigs show: a normal prior about its own value, without which what the data do not show would be infinite.
uncertainty::Posterior PosteriorOf(const Workspace& workspace, const engine::Fit& open,
                                   const engine::Fit& searched, const Ladder& ladder);

}  // namespace touchstone::diagnosis::selection
