#include "server/base/symmetric_eigen.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace touchstone
