#include "server/base/numbers/decompositions.h"

#include <gtest/gtest.h>

#include <cmath>

namespace touchstone {
namespace {

TEST(EigenOfSymmetric, OfTwoByTwoIsTheClosedForm) {
  Eigen::MatrixXd matrix(2, 2);
  matrix << 2, 1, 1, 2;
  const SymmetricEigen eigen = EigenOfSymmetric(matrix);
  EXPECT_NEAR(eigen.values[0], 1, 1e-15);
  EXPECT_NEAR(eigen.values[1], 3, 1e-15);
  EXPECT_TRUE((matrix * eigen.vectors).isApprox(eigen.vectors * eigen.values.asDiagonal(), 1e-14));
  EXPECT_TRUE(EigenvaluesOfSymmetric(matrix).isApprox(eigen.values, 1e-14));
}

TEST(SingularValues, OfAStretchedRotationAreItsStretches) {
  Eigen::MatrixXd matrix(3, 2);
  matrix << 0, -2, 3, 0, 0, 0;
  const SingularValues svd = SingularValuesOf(matrix);
  EXPECT_NEAR(svd.values[0], 3, 1e-15);
  EXPECT_NEAR(svd.values[1], 2, 1e-15);
  EXPECT_TRUE((svd.u * svd.values.asDiagonal() * svd.v.transpose()).isApprox(matrix, 1e-14));
}

TEST(SingularValues, OfFewerRowsThanColumnsTellTheNullSpace) {
  Eigen::MatrixXd matrix(1, 3);
  matrix << 1, 2, 2;
  const SingularValues svd = SingularValuesOf(matrix);
  ASSERT_EQ(svd.v.cols(), 3);
  EXPECT_NEAR((matrix * svd.v.rightCols(2)).norm(), 0, 1e-14);
}

TEST(ColumnSpan, SolveGivesTheShortestOfTheNearest) {
  Eigen::MatrixXd matrix(2, 2);
  matrix << 1, 1, 1, 1;  // only the sum is determined
  const Eigen::VectorXd x = ColumnSpan(matrix).Solve(Eigen::Vector2d(3, 5));
  EXPECT_TRUE(x.isApprox(Eigen::Vector2d(2, 2), 1e-14)) << x.transpose();
}

TEST(SolveLeastSquares, OfALineIsTheClosedForm) {
  Eigen::MatrixXd columns(3, 2);
  columns << 1, 0, 1, 1, 1, 2;
  const Eigen::VectorXd x = SolveLeastSquares(columns, Eigen::Vector3d(1, 2, 6));
  EXPECT_TRUE(x.isApprox(Eigen::Vector2d(0.5, 2.5), 1e-14)) << x.transpose();
  Eigen::MatrixXd values(3, 2);
  values << 1, 2, 2, 4, 6, 12;
  EXPECT_TRUE(SolveLeastSquaresColumns(columns, values).col(1).isApprox(2 * x, 1e-14));
}

TEST(ColumnSpan, OfColumnsThatRepeatHasTheRankOfOne) {
  Eigen::MatrixXd columns(3, 2);
  columns << 3, 6, 4, 8, 0, 0;
  const ColumnSpan span(columns);
  ASSERT_EQ(span.rank(), 1);
  const Eigen::MatrixXd basis = span.Basis();
  EXPECT_NEAR(std::abs(basis(0, 0)), 0.6, 1e-14);
  EXPECT_NEAR(std::abs(basis(1, 0)), 0.8, 1e-14);
  // 5 along the span: x + 2 y = 1 with the least x^2 + y^2.
  EXPECT_TRUE(span.Solve(Eigen::Vector3d(3, 4, 7)).isApprox(Eigen::Vector2d(0.2, 0.4), 1e-14));
}

TEST(SymmetricSolver, ReadsTheLowerTriangleAndSolvesIndefiniteSystems) {
  Eigen::MatrixXd matrix(2, 2);
  matrix << 1, 99, 2, 1;  // of 1 2, 2 1: eigenvalues 3 and -1
  const SymmetricSolver solver(matrix);
  EXPECT_TRUE(solver.Solve(Eigen::Vector2d(5, 4)).isApprox(Eigen::Vector2d(1, 2), 1e-14));
  EXPECT_TRUE(solver.SolveColumns(Eigen::MatrixXd::Identity(2, 2) * 3)
                  .isApprox((Eigen::Matrix2d() << -1, 2, 2, -1).finished(), 1e-14));
}

}  // namespace
}  // namespace touchstone
