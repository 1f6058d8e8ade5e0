#include "server/gateway/arm/motion/line_turn.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/gateway/arm/motion/line_check.h"
#include "server/gateway/arm/motion/motion_planner.h"

namespace touchstone::gateway::arm {
namespace {

using ::testing::HasSubstr;

Eigen::Isometry3d Pose(double x_m, double turn_rad) {
  return Eigen::Translation3d(x_m, 0, 0.3) * Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(turn_rad, Eigen::Vector3d(0.2, 0.1, 1).normalized());
}

TEST(SplitTurns, LeavesLinesWhoseTurnIsCertain) {
  const std::vector<Eigen::Isometry3d> poses = {Pose(0.1, 1), Pose(0.2, 1 + kMaxLineTurnRad), Pose(0.3, 1.5)};
  const auto split = SplitTurns(Pose(0, 0), poses);
  ASSERT_EQ(split.size(), poses.size());
  for (size_t i = 0; i < poses.size(); ++i) EXPECT_TRUE(split[i].isApprox(poses[i], 0));
}

TEST(SplitTurns, PutsAPoseHalfWayOnALineOfHalfATurn) {
  const auto split = SplitTurns(Pose(0, 0.4), {Pose(0.2, 0.4 + kPi)});
  ASSERT_EQ(split.size(), 2u);
  EXPECT_TRUE(split[1].isApprox(Pose(0.2, 0.4 + kPi), 0)) << "the end is what was asked for";
  EXPECT_NEAR(split[0].translation().x(), 0.1, 1e-12);
  EXPECT_NEAR(TurnRad(Pose(0, 0.4), split[0]), kPi / 2, 1e-9);
  EXPECT_NEAR(TurnRad(split[0], split[1]), kPi / 2, 1e-9);
}

TEST(LineCheck, RefusesALineWhoseTurnHasTwoDirections) {
  const MotionLimits limits;
  const calibration::Calibration calibration;
  const LineCheck check(UrKinematics::ForModel("ur3e").value(), limits, calibration);
  const Eigen::Isometry3d from = check.TipAt(limits.home_rad);
  for (const double turn_rad : {-kPi, -3.1, 2.2, 3.1, kPi}) {
    Joints joints = limits.home_rad;
    int beyond = 0;
    const absl::Status refused =
        check.Follow(from, from * Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()), 0.1, true,
                     "the transit", &joints, &beyond);
    EXPECT_EQ(refused.code(), absl::StatusCode::kOutOfRange) << turn_rad;
    EXPECT_THAT(std::string(refused.message()), HasSubstr("at most 120 deg"));
  }
}

}  // namespace
}  // namespace touchstone::gateway::arm
