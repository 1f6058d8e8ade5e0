// The error on rows that a fit did not see: quickly, for a search that asks it often, and by fitting anew, for what is
// reported.
#pragma once

#include "server/diagnosis/inference/fit.h"

namespace touchstone::diagnosis::inference {

// Root mean square, in the unit of the rows, of residuals of rows that were left out, group by group; by block where
// groups are fewer than three or have values of their own. The other rows' columns give the values (one linear step
// from the fit).
double HeldOutRmse(const Experiment& experiment, const Fit& fit);
// By block in any case, so that fits with and without values of single groups compare.
double HeldOutRmseByBlock(const Experiment& experiment, const Fit& fit);

// The same with every value fitted anew, by the simulator and not by a linear step, to what is left: without a group,
// without a fifth of the blocks, without a fifth of the time (of
// each group's own time where groups have values of their own). Of the three the largest, since a model must hold on
// other objects, at other places and at other times. A smooth error takes no part: nothing of it is known where a
// group is left out. Error: CANCELLED, or what the simulator says.
absl::StatusOr<double> HeldOutRmseRefitted(const Experiment& experiment, const Fit& fit);

}  // namespace touchstone::diagnosis::inference
