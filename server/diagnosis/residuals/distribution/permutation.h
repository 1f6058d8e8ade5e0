// p-values from the values of a statistic under permutation.
#pragma once

#include <cstdint>
#include <vector>

namespace touchstone::diagnosis::residuals {

// Probability of at least `observed`, from `permuted` values. Exact, (1 + number at least as large) / (1 +
// number), as long as some are as large. Beyond all of them the tail is that of a scaled chi-square with
// their mean and variance, so that a strong dependence is not limited to 1 / (1 + number). For statistics
// like a sum of squares.
double PermutationP(double observed, const std::vector<double>& permuted);

// P(chi^2 > x) with `degrees_of_freedom` (any positive number), by the approximation of Wilson and Hilferty:
// within a few per cent where it matters, down to 1e-300.
double ChiSquareTail(double x, double degrees_of_freedom);

// Two-sample test of paired values: a[n] and b[n] belong to pose[n]. If both came from one distribution, the
// two could change places in every pose, all values of the pose together, whatever its touches share. The
// statistic is the mean square gap between the two cumulative histograms over fine ranks (Cramer and von
// Mises). Returns the permutation p, 1 without values; a pure function of its arguments, `number` separates
// the tests of one seed. Reads at most 20,000 poses.
double PosePermutationP(const std::vector<double>& a, const std::vector<double>& b,
                        const std::vector<int>& pose, uint64_t seed, uint64_t number);

}  // namespace touchstone::diagnosis::residuals
