#include "server/base/decompositions.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace touchstone {

SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::VectorXd EigenvaluesOfSymmetric(const Eigen::MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

SingularValues SingularValuesOf(const Eigen::MatrixXd& matrix) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(matrix, Eigen::ComputeThinU | Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixU(), svd.matrixV()};
}

Eigen::VectorXd SingularValues::Solve(const Eigen::VectorXd& right) const {
  // As Eigen's own rank: what is smaller than this is zero but for rounding.
  const double least =
      values.size() > 0 ? values[0] * static_cast<double>(values.size()) * Eigen::NumTraits<double>::epsilon()
                        : 0;
  Eigen::VectorXd parts = u.transpose() * right;
  for (Eigen::Index k = 0; k < values.size(); ++k) parts[k] = values[k] > least ? parts[k] / values[k] : 0;
  return v.leftCols(values.size()) * parts;
}

Eigen::VectorXd SolveLeastSquares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& values) {
  return columns.colPivHouseholderQr().solve(values);
}

Eigen::MatrixXd SolveLeastSquaresColumns(const Eigen::MatrixXd& columns, const Eigen::MatrixXd& values) {
  return columns.colPivHouseholderQr().solve(values);
}

ColumnSpan::ColumnSpan(const Eigen::MatrixXd& columns) : factors_(columns) {}

Eigen::MatrixXd ColumnSpan::Basis() const {
  return factors_.householderQ() * Eigen::MatrixXd::Identity(factors_.rows(), factors_.rank());
}

Eigen::VectorXd ColumnSpan::Solve(const Eigen::VectorXd& values) const {
  return factors_.solve(values);
}

SymmetricSolver::SymmetricSolver(const Eigen::MatrixXd& matrix) : factors_(matrix) {}

Eigen::VectorXd SymmetricSolver::Solve(const Eigen::VectorXd& right) const {
  return factors_.solve(right);
}

Eigen::MatrixXd SymmetricSolver::SolveColumns(const Eigen::MatrixXd& right) const {
  return factors_.solve(right);
}

}  // namespace touchstone
