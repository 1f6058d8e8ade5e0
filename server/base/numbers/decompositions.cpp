#include "server/base/numbers/decompositions.h"

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
