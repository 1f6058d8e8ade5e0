// Where a function of one number is largest.
#pragma once

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::touches {

// The place in [low, high] where f, which has one maximum there, is largest, by `steps` steps of the golden section; `max`: its
// value there.
template <typename Function>
double Maximise(const Function& f, double low, double high, int steps, double* max) {
  const double golden = 0.5 * (std::sqrt(5.0) - 1);
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double fa = f(a), fb = f(b);
  for (int step = 0; step < steps; ++step) {
    if (fa > fb)
      high = b, b = a, fb = fa, a = high - golden * (high - low), fa = f(a);
    else
      low = a, a = b, fa = fb, b = low + golden * (high - low), fb = f(b);
  }
  *max = std::max(fa, fb);
  return fa > fb ? a : b;
}

}  // namespace touchstone::diagnosis::touches
