#include "server/geometry/pose.h"

#include <cmath>

#include <gtest/gtest.h>

namespace touchstone::geometry {
namespace {

TEST(Pose, AQuarterTurnAboutZTakesXToY) {
  const Eigen::Matrix3d quarter = RotationFromVector({0, 0, M_PI / 2});
  EXPECT_LT((quarter * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-15);
}

TEST(Pose, NoRotationIsExactlyTheIdentity) {
  EXPECT_EQ(RotationFromVector(Eigen::Vector3d::Zero()), Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
  EXPECT_EQ(RotationVectorOf(Eigen::Matrix3d::Identity()), Eigen::Vector3d(Eigen::Vector3d::Zero()));
}

TEST(Pose, ReadsBackAsTheSameVector) {
  const std::array<double, 6> vector = {0.3, -0.1, 0.25, 0.7, -1.1, 0.4};
  const std::array<double, 6> back = PoseVectorOf(PoseFromVector(vector));
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(back[i], vector[i], 1e-14) << i;
}

TEST(Pose, ARotationBeyondHalfATurnIsTheShorterOneTheOtherWay) {
  const Eigen::Vector3d back = RotationVectorOf(RotationFromVector({0, 4, 0}));
  EXPECT_LT((back - Eigen::Vector3d(0, 4 - 2 * M_PI, 0)).norm(), 1e-14);
}

}  // namespace
}  // namespace touchstone::geometry
