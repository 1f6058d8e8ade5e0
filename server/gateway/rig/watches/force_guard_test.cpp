#include "server/gateway/rig/watches/force_guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "server/gateway/rig/watches/scripted_arm.h"

namespace touchstone::gateway {
namespace {

using ::testing::HasSubstr;

// An arm of which only the states matter.
class StatesOnly : public ScriptedArm {
 public:
  StatesOnly() { Forget(); }
  void Add(double controller_s, double speed_m_s, const Eigen::Vector3d& force_n) {
    Change([&](arm::ArmState* state) {
      state->controller_time_s = controller_s;
      state->base_from_tip.setIdentity();
      state->tip_velocity_m_s = {0, 0, -speed_m_s};
      state->tip_force_n = force_n;
    });
  }
};

TEST(ForceGuard, SubtractsWhatIsFeltAtRest) {
  StatesOnly arm;
  arm.Add(0.00, 0.15, {50, 0, 0});  // still moving, before
  for (int i = 0; i < 10; ++i) arm.Add(1 + 0.002 * i, 0, {0, 0, -8 + (i & 1 ? 0.5 : -0.5)});
  ForceGuard guard(arm, 25, "the approach");
  EXPECT_NEAR(guard.at_rest_n().z(), -8, 1e-9);
  arm.Add(1.03, 0.02, {0, 0, -32});
  EXPECT_TRUE(guard.Check(*arm.State()).ok()) << "24 N beyond the 8 N at rest";
  arm.Add(1.04, 0.02, {0, 0, -34.5});
  const absl::Status pressed = guard.Check(*arm.State());
  EXPECT_EQ(pressed.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(pressed.message()), HasSubstr("the approach pressed with 26.5 N"));
  EXPECT_THAT(std::string(pressed.message()), HasSubstr("beyond the 8.0 N"));
  EXPECT_THAT(std::string(pressed.message()), HasSubstr("at most 25.0 N (limits.max_force_n)"));
}

// Between two looks many states arrive; the peak may be gone with the newest.
TEST(ForceGuard, SeesEveryStateAndNotOnlyTheNewest) {
  StatesOnly arm;
  arm.Add(1, 0, Eigen::Vector3d::Zero());
  ForceGuard guard(arm, 25, "the approach");
  arm.Add(1.002, 0.02, {0, 30, 0});
  arm.Add(1.004, 0.02, {0, 1, 0});
  EXPECT_FALSE(guard.Check(*arm.State()).ok());
}

// Otherwise whatever presses at rest could be pressed with the limit on top of it.
TEST(ForceGuard, TakesNoMoreThanHalfTheLimitForAnOffset) {
  StatesOnly arm;
  arm.Add(1, 0, {0, 0, 40});
  ForceGuard guard(arm, 25, "a motion");
  EXPECT_NEAR(guard.at_rest_n().norm(), 12.5, 1e-9);
  arm.Add(1.002, 0.02, {0, 0, 48});
  EXPECT_FALSE(guard.Check(*arm.State()).ok());
}

// After a stop by the guard the fingers are pressed: the way out must not be one that it forbids.
TEST(ForceGuard, LetsGoOfWhatAMotionBeganAgainstButNeverPressesHarder) {
  StatesOnly arm;
  arm.Add(1, 0, {0, 0, 44});
  ForceGuard guard(arm, 25, "a motion");
  double time_s = 1;
  for (const double force_n : {44.0, 46.0, 40.0, 20.0, 2.0}) {
    arm.Add(time_s += 0.002, 0.02, {0, 0, force_n});
    EXPECT_TRUE(guard.Check(*arm.State()).ok()) << force_n;
  }
  arm.Add(time_s += 0.002, 0.02, {0, 0, 39});
  EXPECT_FALSE(guard.Check(*arm.State()).ok()) << "once it had let go, the limit holds: 26.5 N beyond 12.5 N";

  StatesOnly pressed;
  pressed.Add(1, 0, {0, 0, 44});
  ForceGuard harder(pressed, 25, "a motion");
  pressed.Add(1.002, 0.02, {0, 0, 51});
  EXPECT_FALSE(harder.Check(*pressed.State()).ok());
}

// Setting a payload zeroes an e-Series' sensor, also while something presses: the limit is neither raised nor lowered by
// it (38 and 14 N of 25 once), in no direction.
TEST(ForceGuard, ASensorThatWasZeroedBeforeTheMotionLeavesTheLimitWhereItWas) {
  for (const double felt_n : {0.0, 8.0, -12.0}) {
    for (const double sign : {1.0, -1.0}) {
      StatesOnly arm;
      arm.Add(1, 0, {0, 0, 0});  // after it was zeroed, with felt_n on the tip
      ForceGuard guard(arm, 25, "a motion", {0, 0, felt_n});
      arm.Add(1.002, 0.02, {0, 0, sign * 24.5});
      EXPECT_TRUE(guard.Check(*arm.State()).ok()) << felt_n;
      arm.Add(1.004, 0.02, {0, 0, sign * 25.5});
      EXPECT_FALSE(guard.Check(*arm.State()).ok()) << felt_n;
    }
  }
  // What it began against is let go of as before.
  StatesOnly arm;
  arm.Add(1, 0, {0, 0, 0});
  ForceGuard out(arm, 25, "a motion", {0, 0, 44});
  arm.Add(1.002, 0.02, {0, 0, -30});
  EXPECT_TRUE(out.Check(*arm.State()).ok());
  arm.Add(1.004, 0.02, {0, 0, -5});
  EXPECT_FALSE(out.Check(*arm.State()).ok()) << "it presses again";
}

TEST(ForceGuard, AForceAtRestThatNoErrorOfASensorExplainsForbidsMotions) {
  for (const double force_n : {12.0, 20.0, 30.0}) {
    const absl::Status refused = CheckForceAtRest({0, 0, -force_n}, 25);
    EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition) << force_n;
    EXPECT_THAT(std::string(refused.message()), HasSubstr("limits.payload_kg"));
  }
  EXPECT_TRUE(CheckForceAtRest({0, 0, 10}, 25).ok()) << "what a CB3's estimate may be wrong by";
  EXPECT_TRUE(CheckForceAtRest({0, 0, 300}, std::numeric_limits<double>::infinity()).ok()) << "a hand's";
}

}  // namespace
}  // namespace touchstone::gateway
