// p-values from values of a statistic under permutation.
#pragma once

#include <vector>

namespace touchstone {

// Probability of at least `observed`, from `permuted` values. Exact, (1 + those at least as large) / (1 +
// all), as long as some are as large; beyond all of them by a scaled chi-square with their mean and variance,
// so that strong dependence does not end at 1 / (1 + all). For statistics like a sum of squares.
double PermutationP(double observed, const std::vector<double>& permuted);

// P(chi^2 > x) with `degrees` (any positive number), by Wilson and Hilferty: within a few per cent where it
// matters, down to 1e-300.
double ChiSquareTail(double x, double degrees);

}  // namespace touchstone
