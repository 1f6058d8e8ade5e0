#include "server/diagnosis/residuals/permutation.h"

#include <algorithm>
#include <cmath>

namespace touchstone {

double ChiSquareTail(double x, double degrees) {
  if (x <= 0) return 1;
  const double step = 2 / (9 * degrees);
  const double z = (std::cbrt(x / degrees) - (1 - step)) / std::sqrt(step);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

double PermutationP(double observed, const std::vector<double>& permuted) {
  const double count = permuted.size();
  double larger = 0, sum = 0, squares = 0;
  for (const double value : permuted) {
    // Equal but for rounding is equal.
    larger += value >= observed * (1 - 1e-12);
    sum += value;
    squares += value * value;
  }
  const double p = (1 + larger) / (1 + count);
  if (larger > 0 || count < 20) return p;
  const double mean = sum / count, variance = (squares - sum * mean) / (count - 1);
  if (!(variance > 0) || !(mean > 0)) return p;
  // a * chi^2_d has mean a d and variance 2 a^2 d.
  const double degrees = 2 * mean * mean / variance, factor = variance / (2 * mean);
  return std::min(p, ChiSquareTail(observed / factor, degrees));
}

}  // namespace touchstone
