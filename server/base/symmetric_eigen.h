// Eigenvalues of a symmetric matrix. Eigen's solver is instantiated in symmetric_eigen.cpp alone: it takes five seconds of
// every file that uses it.
#pragma once

#include <Eigen/Core>

namespace touchstone {

struct SymmetricEigen {
  Eigen::VectorXd values;   // ascending
  Eigen::MatrixXd vectors;  // a column per value, orthonormal; empty where only values were asked for
};

// Of a square matrix, of which only the lower triangle is read.
SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& matrix);
Eigen::VectorXd EigenvaluesOfSymmetric(const Eigen::MatrixXd& matrix);

}  // namespace touchstone
