#include "server/gateway/calibration/tool_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/numbers/random.h"

namespace touchstone::gateway::calibration {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

const Vector3d kTipM(0.003, -0.002, 0.12);
const Vector3d kPivotM(0.35, 0.05, 0.02);

// Flange poses whose tips stand in the pivot, but for noise.
std::vector<Isometry3d> Poses(size_t count, double spread_rad, double noise_m, RandomStream* random,
                              bool one_axis = false) {
  std::vector<Isometry3d> poses;
  for (size_t k = 0; k < count; ++k) {
    Vector3d turn(random->Uniform(-1, 1), random->Uniform(-1, 1), random->Uniform(-1, 1));
    if (one_axis) turn.tail<2>().setZero();
    turn *= spread_rad;
    Isometry3d pose = Isometry3d::Identity();
    pose.linear() =
        (Eigen::AngleAxisd(turn.norm(), turn.normalized()) * Eigen::AngleAxisd(M_PI, Vector3d::UnitX()))
            .toRotationMatrix();
    pose.translation() = kPivotM - pose.linear() * kTipM +
                         noise_m * Vector3d(random->Normal(), random->Normal(), random->Normal());
    poses.push_back(pose);
  }
  return poses;
}

TEST(ToolCalibration, FindsTheTipExactlyWithoutNoise) {
  RandomStream random(1, RandomDomain::kTest);
  const auto tool = CalibrateTool(Poses(4, 0.5, 0, &random));
  ASSERT_TRUE(tool.ok()) << tool.status();
  EXPECT_NEAR((tool->flange_from_tip_m - kTipM).norm(), 0, 1e-12);
  EXPECT_NEAR((tool->pivot_m - kPivotM).norm(), 0, 1e-12);
  EXPECT_NEAR(tool->rms_m, 0, 1e-12);
}

TEST(ToolCalibration, StandardErrorsAreThoseOfTheNoise) {
  constexpr int kRounds = 400;
  constexpr double kNoiseM = 50e-6;
  double squares = 0, variance = 0;
  for (int round = 0; round < kRounds; ++round) {
    RandomStream random(2, RandomDomain::kTest, round);
    const auto tool = CalibrateTool(Poses(12, 0.5, kNoiseM, &random));
    ASSERT_TRUE(tool.ok()) << tool.status();
    const Vector3d pull = (tool->flange_from_tip_m - kTipM).cwiseQuotient(tool->flange_from_tip_std_error_m);
    squares += pull.squaredNorm() / 3;
    variance += tool->rms_m * tool->rms_m;
  }
  // Student's t of 30 degrees of freedom has variance 30 / 28.
  EXPECT_NEAR(squares / kRounds, 30.0 / 28, 0.15);
  EXPECT_NEAR(variance / kRounds, kNoiseM * kNoiseM, 0.05 * kNoiseM * kNoiseM);
}

TEST(ToolCalibration, NamesThePoseThatMissedThePoint) {
  RandomStream random(3, RandomDomain::kTest);
  std::vector<Isometry3d> poses = Poses(10, 0.5, 1e-5, &random);
  poses[6].translation().x() += 0.005;
  const auto tool = CalibrateTool(poses);
  ASSERT_TRUE(tool.ok()) << tool.status();
  EXPECT_EQ(tool->worst, 6u);
  EXPECT_GT(tool->worst_m, 0.002);
}

TEST(ToolCalibration, RefusesTooFewPosesAndTooLittleTurning) {
  RandomStream random(4, RandomDomain::kTest);
  EXPECT_THAT(std::string(CalibrateTool(Poses(3, 0.5, 0, &random)).status().message()),
              HasSubstr("has 3 flange poses"));
  EXPECT_THAT(std::string(CalibrateTool(Poses(8, 0.02, 1e-5, &random)).status().message()),
              HasSubstr("turn too little"));
  // About one axis, the tip's place along that axis stays unknown.
  EXPECT_THAT(std::string(CalibrateTool(Poses(8, 0.5, 1e-5, &random, true)).status().message()),
              HasSubstr("1.00, "));
}

}  // namespace
}  // namespace touchstone::gateway::calibration
