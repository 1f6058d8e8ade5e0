#include "server/gateway/rig/watches/arm_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/watches/scripted_arm.h"

namespace touchstone::gateway {
namespace {

using arm::ArmState;
using arm::RobotMode;
using arm::RuntimeState;
using arm::SafetyMode;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ArmWatchTest : public testing::Test {
 protected:
  std::vector<std::string> Look(ArmWatch::Doing doing = {}) { return watch_.Look(arm_, doing); }
  void Say(const std::function<void(ArmState*)>& change) { arm_.Change(change); }
  void SetMode(RobotMode mode) {
    Say([mode](ArmState* state) { state->robot_mode = mode; });
  }
  // A program runs or not, for so long.
  void Pass(double seconds, RuntimeState runtime) {
    Say([&](ArmState* state) {
      state->runtime_state = runtime;
      state->controller_time_s += seconds, state->host_time_s = host_s_ += seconds;
    });
  }

  static constexpr ArmWatch::Doing kMoving{true, false, false}, kPowering{false, true, false},
      kAsked{false, false, true};
  ScriptedArm arm_;
  ArmWatch watch_;
  double host_s_ = timing::HostNowS() + 1;
};

TEST_F(ArmWatchTest, AnArmThatRunsAndRestsIsLeftAlone) {
  EXPECT_THAT(Look(), IsEmpty());
  Say([](ArmState*) {});
  EXPECT_THAT(Look(kAsked), IsEmpty());
}

// Every number that UR publishes, and those that nobody knows: only NORMAL and REDUCED let an arm move.
TEST_F(ArmWatchTest, EverySafetyModeButNormalAndReducedLatchesWhenItInterruptsAMotion) {
  for (int mode = 0; mode <= 255; ++mode) {
    ArmWatch watch;
    arm_.SetSafety(SafetyMode::kNormal);
    watch.Look(arm_, kMoving);
    arm_.SetSafety(static_cast<SafetyMode>(mode));
    arm_.SetSafety(SafetyMode::kNormal);  // however short it was
    if (mode == 1 || mode == 2) {
      EXPECT_THAT(watch.Look(arm_, kMoving), IsEmpty()) << mode;
    } else {
      EXPECT_THAT(watch.Look(arm_, kMoving),
                  ElementsAre(AllOf(HasSubstr(arm::SafetyModeName(static_cast<SafetyMode>(mode))),
                                    HasSubstr("during program"))))
          << mode;
    }
  }
}

TEST_F(ArmWatchTest, SafeguardsAndEnablingDevicesLatchBetweenMotionsOnlyIfOneIsAskedFor) {
  for (const int mode : {5, 12, 13, 14, 16, 18, 19, 22}) {
    ArmWatch watch;
    arm_.SetSafety(static_cast<SafetyMode>(mode));
    EXPECT_THAT(watch.Look(arm_, {}), IsEmpty()) << mode;
    EXPECT_THAT(watch.Look(arm_, kAsked), ElementsAre(HasSubstr("when a motion was asked for"))) << mode;
    EXPECT_THAT(watch.Look(arm_, kAsked), IsEmpty()) << mode << ": once is enough";
    arm_.SetSafety(SafetyMode::kNormal);
  }
  for (const int mode : {3, 4, 6, 7, 8, 9, 10, 11, 15, 17, 20, 21, 23, 42, 255}) {
    ArmWatch watch;
    watch.Look(arm_, {});
    arm_.SetSafety(static_cast<SafetyMode>(mode));
    EXPECT_THAT(watch.Look(arm_, {}), ElementsAre(HasSubstr("between motions"))) << mode;
    arm_.SetSafety(SafetyMode::kNormal);
  }
}

// --- Unexpected start-up: ISO 12100, 6.2.11.4; IEC 60204-1, 9.2.3.2

TEST_F(ArmWatchTest, AnArmThatLosesItsPowerAfterItRanLatchesOnce) {
  Look();
  SetMode(RobotMode::kPowerOff);
  EXPECT_THAT(Look(), ElementsAre(AllOf(HasSubstr("POWER_OFF"), HasSubstr("between motions"))));
  SetMode(RobotMode::kIdle);
  EXPECT_THAT(Look(), IsEmpty());
  SetMode(RobotMode::kRunning);
  EXPECT_THAT(Look(), IsEmpty());
  SetMode(RobotMode::kIdle);
  EXPECT_THAT(Look(), ElementsAre(HasSubstr("IDLE"))) << "its brakes were closed";
}

TEST_F(ArmWatchTest, AnArmThatIsFoundOffAndWhatThisGatewaySwitchesIsNoSurprise) {
  SetMode(RobotMode::kPowerOff);
  ArmWatch watch;
  EXPECT_THAT(watch.Look(arm_, {}), ElementsAre(HasSubstr("POWER_OFF"))) << "it was seen running first";
  ArmWatch another;
  SetMode(RobotMode::kPowerOff);
  ScriptedArm off;
  off.Forget();
  off.Change([](ArmState* state) { state->robot_mode = RobotMode::kPowerOff; });
  EXPECT_THAT(another.Look(off, {}), IsEmpty());
  off.Change([](ArmState* state) { state->robot_mode = RobotMode::kRunning; });
  off.Change([](ArmState* state) { state->robot_mode = RobotMode::kPowerOff; });
  EXPECT_THAT(another.Look(off, kPowering), IsEmpty());
  EXPECT_THAT(another.Look(off, {}), IsEmpty());
}

TEST_F(ArmWatchTest, AnEmergencyStopIsToldOnceThoughItTakesThePowerToo) {
  Look();
  Say([](ArmState* state) {
    state->safety_mode = SafetyMode::kRobotEmergencyStop, state->robot_mode = RobotMode::kPowerOff;
  });
  EXPECT_THAT(Look(), ElementsAre(HasSubstr("ROBOT_EMERGENCY_STOP")));
  arm_.SetSafety(SafetyMode::kNormal);
  EXPECT_THAT(Look(), IsEmpty());
}

TEST_F(ArmWatchTest, AControllerThatWasStartedAnewLatchesIfItsArmHadRun) {
  arm_.Pass(1);
  Look();
  arm_.Forget();
  Say([](ArmState* state) { state->controller_time_s = 0.1, state->robot_mode = RobotMode::kRunning; });
  EXPECT_THAT(Look(), ElementsAre(HasSubstr("started anew")));
  arm_.Forget();
  Say([](ArmState* state) { state->controller_time_s = 0.05, state->robot_mode = RobotMode::kPowerOff; });
  EXPECT_THAT(Look(), ElementsAre(HasSubstr("started anew")));
  arm_.Forget();
  Say([](ArmState* state) { state->controller_time_s = 0.01; });
  EXPECT_THAT(Look(), IsEmpty()) << "it was off before";
}

// --- Programs of others

TEST_F(ArmWatchTest, AForeignProgramLatchesAtOnceAndWithItsName) {
  Look(kMoving);
  arm_.BeginForeign("pick_and_place\x1b[2J");
  EXPECT_THAT(Look(kMoving),
              ElementsAre(AllOf(HasSubstr("pick_and_place"), testing::Not(HasSubstr("\x1b")))));
  EXPECT_THAT(Look(kMoving), IsEmpty());
  arm_.BeginForeign("pick_and_place");
  EXPECT_THAT(Look(), ElementsAre(HasSubstr("pick_and_place")));
}

TEST_F(ArmWatchTest, AProgramThatRunsWhileNoneOfOursShouldLatchesAfterASecond) {
  Pass(0.1, RuntimeState::kPlaying);
  EXPECT_THAT(Look(), IsEmpty());
  Pass(0.8, RuntimeState::kPlaying);
  EXPECT_THAT(Look(), IsEmpty()) << "our own may be at its last cycles";
  Pass(0.3, RuntimeState::kPlaying);
  EXPECT_THAT(Look(), ElementsAre(HasSubstr("not this gateway's")));
  Pass(5, RuntimeState::kPlaying);
  EXPECT_THAT(Look(), IsEmpty()) << "once is enough";
  Pass(5, RuntimeState::kPlaying);
  EXPECT_THAT(Look(kMoving), IsEmpty()) << "ours";
  Pass(0.1, RuntimeState::kStopped);
  Pass(0.1, RuntimeState::kPlaying);
  EXPECT_THAT(Look(), IsEmpty());
}

}  // namespace
}  // namespace touchstone::gateway
