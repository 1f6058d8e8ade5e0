#include "tests/rig/world/hidden_physics.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/rig/world/oscillator.h"
#include "tests/rig/world/resting_face.h"

namespace touchstone::rig {
namespace {

using Vec = Eigen::Vector3d;

hidden::Scenario TwoObjects() {
  hidden::Scenario scenario;
  hidden::Triangles triangle{{Vec(0, 0, 0), Vec(1, 0, 0), Vec(0, 1, 0)}, {{0, 1, 2}}};
  for (const char* name : {"a", "b.1"})
    scenario.objects.push_back(std::make_shared<hidden::Solid>(name, triangle));
  return scenario;
}

TEST(HiddenPhysics, ReadsTheNamesAndUnitsOfTheCatalogue) {
  hidden::Scenario scenario = TwoObjects();
  Hide("tip_radius.radius_mm=2.5", &scenario);
  Hide("surface_error.rms_mm=0.1", &scenario);
  Hide("channel_latency.latency_us=1,-3,2", &scenario);
  Hide("object_pose.translation_mm=1,2,3", &scenario);
  Hide("object_pose.b.1.rotation_deg=0,0,4", &scenario);
  ASSERT_EQ(scenario.hidden.size(), 4u);
  EXPECT_EQ(scenario.hidden[0].values, (std::vector<double>{2.5}));
  EXPECT_EQ(scenario.hidden[1].values, (std::vector<double>{0.1, 20}));
  EXPECT_EQ(scenario.hidden[2].values, (std::vector<double>{1, -3, 2}));
  EXPECT_EQ(scenario.hidden[3].values, (std::vector<double>{1, 2, 3, 0, 0, 0, 1, 2, 3, 0, 0, 4}));
  AddUnlisted("lead_screw=0.3,4", &scenario);
  EXPECT_EQ(scenario.unlisted[0].k_mm, 0.3);
  EXPECT_EQ(scenario.unlisted[0].second, 4);
}

TEST(HiddenPhysics, RefusesWhatItDoesNotKnow) {
  hidden::Scenario scenario = TwoObjects();
  for (const char* wrong :
       {"tip_radius=2", "tip_radius.radius_cm=2", "tip_radius.radius_mm", "tip_radius.radius_mm=x",
        "tip_radius.radius_mm=1,2", "channel_latency.latency_us=1", "object_pose.c.rotation_deg=0,0,1",
        "tip_radius.a.radius_mm=1", "tip_radius.radius_mm="})
    EXPECT_THROW(Hide(wrong, &scenario), std::invalid_argument) << wrong;
  EXPECT_THROW(AddUnlisted("ghost=1", &scenario), std::invalid_argument);
}

TEST(Placement, TurnsEachFaceUpAndLeavesTheObjectOnItsPlate) {
  const Vec low(-0.01, 0.02, -0.03), high(0.05, 0.10, 0.04);
  const Eigen::Isometry3d plus_z(Eigen::Translation3d(0.3, 0.1, 0.2));
  for (size_t face = 0; face < 6; ++face) {
    const Eigen::Isometry3d pose = BaseFromPlacedObject(plus_z, low, high, FaceNames()[face]);
    const Vec outward = (face % 2 == 0 ? 1 : -1) * Vec::Unit(face / 2);
    EXPECT_NEAR((pose.linear() * outward - Vec::UnitZ()).norm(), 0, 1e-12) << face;
    EXPECT_NEAR(pose.linear().determinant(), 1, 1e-12);
    double lowest = 1e9;
    Vec least = Vec::Constant(1e9), most = Vec::Constant(-1e9);
    for (int k = 0; k < 8; ++k) {
      const Vec corner =
          pose * Vec(k & 1 ? low.x() : high.x(), k & 2 ? low.y() : high.y(), k & 4 ? low.z() : high.z());
      lowest = std::min(lowest, corner.z());
      least = least.cwiseMin(corner), most = most.cwiseMax(corner);
    }
    EXPECT_NEAR(lowest, 0.2 + low.z(), 1e-12) << face;
    const Vec centre = plus_z * Vec(0.5 * (low + high));
    EXPECT_NEAR((0.5 * (least + most) - centre).head<2>().norm(), 0, 1e-12) << face;
  }
  EXPECT_TRUE(BaseFromPlacedObject(plus_z, low, high, "+z").isApprox(plus_z));
  EXPECT_THROW(BaseFromPlacedObject(plus_z, low, high, "z"), std::invalid_argument);
}

TEST(Oscillator, DriftsWithoutAStepAndWraps) {
  Oscillator oscillator(1e6, 100, 4'294'000'000, 10);
  EXPECT_NEAR(oscillator.TicksAt(11), 4'294'000'000 + 1e6 + 100, 1e-3);
  EXPECT_EQ(oscillator.ReadingAt(12), static_cast<uint32_t>(4'296'000'200 - (uint64_t{1} << 32)));
  oscillator.SetDriftPpm(-50, 12);
  EXPECT_NEAR(oscillator.TicksAt(12), 4'296'000'200, 1e-3);
  EXPECT_NEAR(oscillator.TicksAt(13), 4'296'000'200 + 1e6 - 50, 1e-3);
  EXPECT_NEAR(oscillator.TicksAt(11), 4'294'000'000 + 1e6 + 100, 1e-3);
}

}  // namespace
}  // namespace touchstone::rig
