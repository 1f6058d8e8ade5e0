// How much one effect's response resembles another's.
#pragma once

#include <algorithm>

#include <Eigen/Core>

#include "server/base/numbers/decompositions.h"

namespace touchstone::diagnosis::engine {

// Share of a response's squares that columns explain by least squares, 0 to 1; no smooth error takes part. `response` must
// not be 0; columns may be.
inline double ShareExplained(const Eigen::MatrixXd& given, const Eigen::VectorXd& response) {
  Eigen::MatrixXd columns(given.rows(), 0);
  for (int c = 0; c < given.cols(); ++c) {
    const double norm = given.col(c).norm();
    if (!(norm > 0)) continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols(1) = given.col(c) / norm;
  }
  if (columns.cols() == 0) return 0;
  const Eigen::VectorXd left = response - columns * SolveLeastSquaresColumns(columns, response);
  return std::clamp(1 - left.squaredNorm() / response.squaredNorm(), 0.0, 1.0);
}

}  // namespace touchstone::diagnosis::engine
