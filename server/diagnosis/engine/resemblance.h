// How much one effect's response resembles another's.
#pragma once

#include <algorithm>

#include <Eigen/Core>

#include "server/base/decompositions.h"

namespace touchstone::diagnosis::engine {

// Share of a response's squares that columns explain by least squares, 0 to 1; no smooth error takes part. `response` must
// not be 0.
inline double ShareExplained(Eigen::MatrixXd columns, const Eigen::VectorXd& response) {
  for (int c = 0; c < columns.cols(); ++c) columns.col(c) /= std::max(columns.col(c).norm(), 1e-300);
  const Eigen::VectorXd left = response - columns * SolveLeastSquaresColumns(columns, response);
  return std::clamp(1 - left.squaredNorm() / response.squaredNorm(), 0.0, 1.0);
}

}  // namespace touchstone::diagnosis::engine
