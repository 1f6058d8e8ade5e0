// Decompositions of matrices whose sizes are known at run time. What stands here is instantiated in decompositions.cpp alone:
// each of Eigen's takes two to ten seconds of every file that uses it directly.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/QR>

namespace touchstone {

struct SymmetricEigen {
  Eigen::VectorXd values;   // ascending
  Eigen::MatrixXd vectors;  // a column per value, orthonormal; empty where only values were asked for
};

// Of a square matrix, of which only the lower triangle is read.
SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& matrix);
Eigen::VectorXd EigenvaluesOfSymmetric(const Eigen::MatrixXd& matrix);

// matrix = u * diag(values) * v^T.
struct SingularValues {
  Eigen::VectorXd values;  // descending, never negative
  Eigen::MatrixXd u;       // as many columns as there are values
  Eigen::MatrixXd v;       // square: the columns beyond the values span the null space
};
SingularValues SingularValuesOf(const Eigen::MatrixXd& matrix);

// The x of least |columns * x - values|, by QR with column pivoting; columns that others span get 0.
Eigen::VectorXd SolveLeastSquares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& values);
// For each column of values.
Eigen::MatrixXd SolveLeastSquaresColumns(const Eigen::MatrixXd& columns, const Eigen::MatrixXd& values);

// The span of columns of any rank.
class ColumnSpan {
 public:
  explicit ColumnSpan(const Eigen::MatrixXd& columns);
  Eigen::Index rank() const { return factors_.rank(); }
  Eigen::MatrixXd Basis() const;  // orthonormal, as many columns as the rank
  // The x of least |x| among those of least |columns * x - values|.
  Eigen::VectorXd Solve(const Eigen::VectorXd& values) const;

 private:
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factors_;
};

// A symmetric matrix as L D L^T with pivoting; semidefinite ones too. Only the lower triangle is read.
class SymmetricSolver {
 public:
  explicit SymmetricSolver(const Eigen::MatrixXd& matrix);
  Eigen::VectorXd Solve(const Eigen::VectorXd& right) const;
  Eigen::MatrixXd SolveColumns(const Eigen::MatrixXd& right) const;

 private:
  Eigen::LDLT<Eigen::MatrixXd> factors_;
};

}  // namespace touchstone
