// The error on rows that a fit did not see.
#pragma once

#include "server/diagnosis/inference/fit.h"

namespace touchstone::diagnosis::inference {

// Root mean square, in the unit of the rows, of residuals of rows that were left out, group by group; by block where
// groups are fewer than three or have values of their own. The other rows' columns give the values (one linear step
// from the fit).
double HeldOutRmse(const Experiment& experiment, const Fit& fit);
// By block in any case, so that fits with and without values of single groups compare.
double HeldOutRmseByBlock(const Experiment& experiment, const Fit& fit);

}  // namespace touchstone::diagnosis::inference
