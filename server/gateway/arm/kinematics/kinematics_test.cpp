#include "server/gateway/arm/kinematics/kinematics.h"

#include <gtest/gtest.h>

#include <random>

#include "server/base/units.h"

namespace touchstone::gateway::arm {
namespace {

UrKinematics Arm(const std::string& model) {
  return UrKinematics::ForModel(model).value();
}

Joints RandomJoints(std::mt19937_64* random) {
  std::uniform_real_distribution<double> angle(-kPi, kPi);
  Joints joints;
  for (double& joint : joints) joint = angle(*random);
  return joints;
}

double TurnBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle();
}

// At zero a UR arm lies stretched along -x; the flange stands d1 - d5 high, d4 + d6 to the side of -y.
TEST(UrKinematics, StretchedArmReachesWhatItsLinksAddUpTo) {
  const Eigen::Isometry3d ur3 = Arm("ur3").Forward({{0, 0, 0, 0, 0, 0}});
  EXPECT_NEAR(ur3.translation().x(), -0.45690, 1e-12);
  EXPECT_NEAR(ur3.translation().y(), -0.19425, 1e-12);
  EXPECT_NEAR(ur3.translation().z(), 0.06655, 1e-12);
  const Eigen::Isometry3d ur3e = Arm("ur3e").Forward({{0, 0, 0, 0, 0, 0}});
  EXPECT_NEAR(ur3e.translation().x(), -0.45675, 1e-12);
  EXPECT_NEAR(ur3e.translation().y(), -0.22315, 1e-12);
  EXPECT_NEAR(ur3e.translation().z(), 0.06650, 1e-12);
  EXPECT_LT((ur3e.linear().col(2) - Eigen::Vector3d(0, -1, 0)).norm(), 1e-12) << "the flange looks along -y";
}

// Stretched to the side at zero, as published: UR5e 0.425 + 0.3922, UR10e 0.6127 + 0.57155 m.
TEST(UrKinematics, LargerArmsAreInTheTable) {
  EXPECT_NEAR(Arm("ur5e").Forward({{0, 0, 0, 0, 0, 0}}).translation().x(), -0.8172, 1e-12);
  EXPECT_NEAR(Arm("ur10e").Forward({{0, 0, 0, 0, 0, 0}}).translation().x(), -1.18425, 1e-12);
}

// A wrong row would pass every test of the others.
TEST(ArmModels, EveryRowIsWhole) {
  for (const ArmModel& model : ArmModels()) {
    EXPECT_EQ(model.rtde_hz, model.e_series ? 500 : 125) << model.name;
    const double reach_m = -model.dh[1].a_m - model.dh[2].a_m;
    EXPECT_NEAR(reach_m, model.reach_m, 0.15 * model.reach_m) << model.name;
    for (const double speed : model.max_joint_speed_rad_s) EXPECT_GE(speed, 2 * kPi / 3) << model.name;
    for (const ArmModel& other : ArmModels())
      EXPECT_EQ(&other == &model, Arm(other.name).Calibrated(model.dh).ok())
          << model.name << " as " << other.name;
  }
  EXPECT_EQ(ArmModelNames(), "ur3, ur3e, ur5e or ur10e");
}

TEST(UrKinematics, InverseFindsTheJointsThatLedToAPose) {
  std::mt19937_64 random(4);
  for (const std::string model : {"ur3", "ur3e", "ur5e", "ur10e"}) {
    const UrKinematics arm = Arm(model);
    for (int i = 0; i < 3000; ++i) {
      const Joints joints = RandomJoints(&random);
      if (std::abs(std::sin(joints[4])) < 0.05) continue;  // joints 4 and 6 are one there
      const std::vector<Joints> found = arm.Inverse(arm.Forward(joints), joints);
      ASSERT_FALSE(found.empty());
      EXPECT_LT(Farthest(found.front(), joints), 1e-6) << model << " " << i;
    }
  }
}

TEST(UrKinematics, EverySolutionReachesThePose) {
  std::mt19937_64 random(5);
  const UrKinematics arm = Arm("ur3e");
  int most = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Isometry3d pose = arm.Forward(RandomJoints(&random));
    const std::vector<Joints> found = arm.Inverse(pose, RandomJoints(&random));
    most = std::max(most, static_cast<int>(found.size()));
    for (const Joints& joints : found) {
      EXPECT_LT((arm.Forward(joints).translation() - pose.translation()).norm(), 1e-8);
      EXPECT_LT(TurnBetween(arm.Forward(joints), pose), 1e-7);
    }
  }
  EXPECT_EQ(most, 8);
}

TEST(UrKinematics, SolutionsAreTurnedByWholeTurnsTowardsTheGivenJoints) {
  const UrKinematics arm = Arm("ur3");
  Joints joints{{0.3, -1.2, 1.1, -1.5, -1.4, 0.2}};
  joints[5] += 4 * kPi, joints[0] -= 2 * kPi;
  EXPECT_LT(Farthest(arm.Inverse(arm.Forward(joints), joints).front(), joints), 1e-9);
}

TEST(UrKinematics, OutOfReachHasNoSolution) {
  Eigen::Isometry3d far = Eigen::Isometry3d::Identity();
  far.translation() << 0.9, 0, 0.2;
  EXPECT_TRUE(Arm("ur3e").Inverse(far, Joints{}).empty());
}

TEST(UrKinematics, CalibratedArmIsInvertedExactly) {
  const UrKinematics nominal = Arm("ur3e");
  DhTable table = nominal.table();
  table[1].alpha_rad += 4e-4, table[1].a_m += 3e-4, table[2].alpha_rad -= 7e-4, table[3].d_m += 5e-4;
  table[4].theta_rad += 1e-3;
  const UrKinematics arm = nominal.Calibrated(table).value();
  std::mt19937_64 random(6);
  int solved = 0;
  for (int i = 0; i < 300; ++i) {
    const Joints joints = RandomJoints(&random);
    if (std::abs(std::sin(joints[4])) < 0.2 || std::abs(std::sin(joints[2])) < 0.2) continue;
    const std::vector<Joints> found = arm.Inverse(arm.Forward(joints), joints);
    if (found.empty()) continue;  // at the edge of what the nominal arm reaches
    EXPECT_LT(Farthest(found.front(), joints), 1e-6);
    EXPECT_LT(Farthest(arm.Nearest(arm.Forward(joints), joints).value(), joints), 1e-6);
    ++solved;
  }
  EXPECT_GT(solved, 150);
}

TEST(UrKinematics, TableOfAnotherArmIsRefused) {
  DhTable ur5 = Arm("ur3").table();
  ur5[1].a_m = -0.425, ur5[2].a_m = -0.39225;
  const auto refused = Arm("ur3").Calibrated(ur5);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.status().message().find("model"), std::string::npos);
  EXPECT_FALSE(UrKinematics::ForModel("ur10").ok());
}

}  // namespace
}  // namespace touchstone::gateway::arm
