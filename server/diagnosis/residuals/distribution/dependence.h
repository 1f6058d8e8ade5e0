// Whether residuals depend on a covariate: a permutation test that takes repeats of a pose together.
#pragma once

#include <cstdint>
#include <vector>

namespace touchstone::diagnosis::residuals {

// One finger of one touch, as the curves and the test of dependence see it.
struct ResidualCell {
  int touch = 0, pose = 0, finger = 0;
  double covariate = 0;              // in the covariate's unit
  double before_s = 0, after_s = 0;  // residuals of the initial and the improved model; after_s may be NaN
};

// The bin of a value among bins with the upper ends `ends` (ascending, at least one).
int BinOf(const std::vector<double>& ends, double value);

// Permutation p of the between-bin sum of squares of `before_s` over the bins `ends` of the covariate, all
// fingers together; a finger's own mean is no dependence. Cells are sorted by pose and, within a pose, by
// touch.
//
// If the residual does not depend on the covariate, poses may change places, each with all of its repeats. A
// covariate that varies among the repeats of a pose (time, the previous press) is tested there instead: the
// mean of the pose is removed and the touches of a pose change places. `number` separates the tests of one
// seed.
double DependenceP(const std::vector<ResidualCell>& cells, const std::vector<double>& ends, int fingers,
                   uint64_t seed, int number);

}  // namespace touchstone::diagnosis::residuals
