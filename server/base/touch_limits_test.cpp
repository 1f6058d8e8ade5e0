#include "server/base/touch_limits.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <random>

namespace touchstone {
namespace {

TEST(TouchLimits, WhatIsExactStaysAsItIsAndBecomesSoAtOnce) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 1000; ++k) {
    Eigen::Vector3d approach = Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    Eigen::Vector3d lateral = approach.unitOrthogonal();
    approach *= 1 + 5e-4 * std::tanh(normal(random));
    lateral += 5e-4 * std::tanh(normal(random)) * approach;
    ASSERT_EQ(MakeOrthonormal(&approach, &lateral), VectorFlaw::kNone);
    EXPECT_NEAR(approach.norm(), 1, 1e-15);
    EXPECT_NEAR(lateral.norm(), 1, 1e-15);
    EXPECT_NEAR(approach.dot(lateral), 0, 1e-15);
    const Eigen::Vector3d approach_before = approach, lateral_before = lateral;
    ASSERT_EQ(MakeOrthonormal(&approach, &lateral), VectorFlaw::kNone);
    EXPECT_EQ(approach, approach_before);
    EXPECT_EQ(lateral, lateral_before);
  }
}

TEST(TouchLimits, SaysWhatIsWrong) {
  const auto flaw = [](Eigen::Vector3d approach, Eigen::Vector3d lateral) {
    return MakeOrthonormal(&approach, &lateral);
  };
  EXPECT_EQ(flaw({0, 0, -1.002}, {1, 0, 0}), VectorFlaw::kApproachLength);
  EXPECT_EQ(flaw({0, 0, NAN}, {1, 0, 0}), VectorFlaw::kApproachLength);
  EXPECT_EQ(flaw({0, 0, -1}, {0.99, 0, 0}), VectorFlaw::kLateralLength);
  EXPECT_EQ(flaw({0, 0, -1}, Eigen::Vector3d(1, 0, 0.01).normalized()), VectorFlaw::kNotPerpendicular);
}

}  // namespace
}  // namespace touchstone
