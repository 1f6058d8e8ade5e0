// The error on rows that a fit did not see: quickly, for a search that asks it often, and by fitting anew, for what is
// reported.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/fit/fit.h"

namespace touchstone::diagnosis::engine {

// Root mean square, in the unit of the rows, of residuals of rows that were left out, group by group; by block where
// groups are fewer than three or have values of their own. The other rows' columns give the values (one linear step
// from the fit).
double HeldOutRmse(const Experiment& experiment, const Fit& fit);
// The sums of squares of which that is the root mean, part by part; and the same by fits that are made anew. Errors of
// those: CANCELLED, or what the simulator says.
std::vector<double> HeldOutSquares(const Experiment& experiment, const Fit& fit);
absl::StatusOr<std::vector<double>> HeldOutSquaresRefitted(const Experiment& experiment, const Fit& fit);
// By block in any case, so that fits with and without values of single groups compare.
double HeldOutRmseByBlock(const Experiment& experiment, const Fit& fit);

// By how much the logarithm of a part's squares falls from one fit to another: mean over the parts, and its standard
// error. Squares below `negligible` count as that.
struct HeldOutFall {
  double mean = 0, std_error = 0;
};
HeldOutFall FallOfHeldOut(const std::vector<double>& before, const std::vector<double>& after,
                          double negligible);

// A fit that did not see these rows; what it `predicted` of them means nothing.
struct RefitWithoutPart {
  std::vector<int> rows;
  Fit fit;
};

// Every value fitted anew, by the simulator and not by a linear step, to what is left: without each group, without
// each fifth of the blocks, without each fifth of the time (of each group's own time where groups have values of
// their own). Each of these divisions leaves every row out once; without groups only where there are three or more, and
// none has values of its own. A smooth error takes no part: nothing of it is known where a group is left out. Error:
// CANCELLED, or what the simulator says.
absl::StatusOr<std::vector<std::vector<RefitWithoutPart>>> RefitWithoutParts(const Experiment& experiment,
                                                                             const Fit& fit);

// Root mean square of rows that those fits did not see, of the divisions the largest: a model must hold on other
// objects, at other places and at other times. Errors as RefitWithoutParts.
absl::StatusOr<double> HeldOutRmseRefitted(const Experiment& experiment, const Fit& fit);

}  // namespace touchstone::diagnosis::engine
