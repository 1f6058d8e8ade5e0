// The covariance of smooth random fields over space: Matern-5/2.
#pragma once

#include <cmath>

namespace touchstone {

// Correlation of two places: 1 at distance 0, 0.52 a length apart, 0.14 at two lengths.
inline double Matern52(double distance, double length) {
  const double x = std::sqrt(5.0) * distance / length;
  return (1 + x + x * x / 3) * std::exp(-x);
}

}  // namespace touchstone
