#include "server/gateway/rig/force_guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::gateway {
namespace {

using ::testing::HasSubstr;

// An arm that has only states.
class StatesOnly : public arm::Arm {
 public:
  void Add(double controller_s, double speed_m_s, const Eigen::Vector3d& force_n) {
    arm::ArmState state;
    state.controller_time_s = controller_s;
    state.tip_velocity_m_s.z() = -speed_m_s;
    state.tip_force_n = force_n;
    states_.push_back(state);
  }
  absl::StatusOr<arm::ArmState> State() const override { return states_.back(); }
  std::vector<arm::ArmState> History(double from_s, double to_s) const override {
    std::vector<arm::ArmState> found;
    for (const arm::ArmState& state : states_)
      if (state.controller_time_s >= from_s && state.controller_time_s <= to_s) found.push_back(state);
    return found;
  }
  absl::Status Ready() const override { return absl::OkStatus(); }
  absl::Status StartTouch(const arm::ArmTouch&, const arm::StartGuard&) override { return absl::OkStatus(); }
  absl::Status BeginApproach(uint32_t, const arm::StartGuard&) override { return absl::OkStatus(); }
  absl::Status EndApproach(uint32_t) override { return absl::OkStatus(); }
  absl::Status MoveThrough(uint32_t, const std::vector<Eigen::Isometry3d>&,
                           const std::vector<std::array<double, 6>>&, const arm::StartGuard&) override {
    return absl::OkStatus();
  }
  absl::Status Stop() override { return absl::OkStatus(); }
  absl::Status PowerOn(const arm::StartGuard&) override { return absl::OkStatus(); }
  void SendHeartbeat() override {}
  timing::ClockEstimate ControllerClock() const override { return {}; }
  double StateRateHz() const override { return 500; }
  std::string Model() const override { return "ur3e"; }
  std::string Address() const override { return ""; }
  std::string Version() const override { return ""; }

 private:
  std::vector<arm::ArmState> states_;
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

}  // namespace
}  // namespace touchstone::gateway
