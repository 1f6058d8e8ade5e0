// Tails and quantiles of the distributions that tests of significance use. Boost.Math is included in distributions.cpp alone:
// its templates take seconds of every file that includes them.
#pragma once

namespace touchstone {

// P(X > x), X chi-squared with so many degrees of freedom (not necessarily whole); 1 where x <= 0, or none is free.
double ChiSquaredTail(double x, double degrees_of_freedom);
// The value below which X lies with probability p (0 to 1, both excluded).
double ChiSquaredQuantile(double p, double degrees_of_freedom);

// P(X > x), X noncentral chi-squared: of the sum of squares of standard normal numbers whose means squared sum to
// `noncentrality` (>= 0).
double NoncentralChiSquaredTail(double x, double degrees_of_freedom, double noncentrality);
// The noncentrality at which P(X > x) is p (0 to 1, both excluded); 0 where it is larger without any.
double NoncentralityForTail(double x, double degrees_of_freedom, double p);

// P(T > t), T Student's with so many degrees of freedom (> 0).
double StudentTail(double t, double degrees_of_freedom);
double StudentQuantile(double p, double degrees_of_freedom);

// P(F > f), F Fisher's ratio of two mean squares with so many degrees of freedom (> 0 each), f >= 0.
double FisherTail(double f, double numerator_degrees_of_freedom, double denominator_degrees_of_freedom);

// P(X > x), X gamma distributed with this mean and variance (> 0 each), x >= 0.
double GammaTail(double x, double mean, double variance);

// The value below which X lies with probability p, X beta distributed with these shapes (> 0 each).
double BetaQuantile(double p, double a, double b);

}  // namespace touchstone
