// What closes the latch of Stop, and what goes out while it is closed, with an arm and an end effector that a test
// moves by hand.
#include <absl/cleanup/cleanup.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>

#include "server/base/test_folder.h"
#include "server/base/threads/manual_clock.h"
#include "server/gateway/rig/idle_effector.h"
#include "server/gateway/rig/rig.h"
#include "server/gateway/rig/watches/scripted_arm.h"

namespace touchstone::gateway {
namespace {

using arm::ArmState;
using arm::MotionPhase;
using arm::RuntimeState;
using arm::SafetyMode;
using testing::AllOf;
using testing::HasSubstr;

class RigLatch : public testing::Test {
 protected:
  ~RigLatch() override { End(); }

  void MakeParts() {
    parts_.changes = std::make_unique<timing::ChangeNotifier>();
    auto arm = std::make_unique<ScriptedArm>(parts_.changes.get());
    arm_ = arm.get();
    parts_.arm = std::move(arm);
    parts_.effector = std::make_unique<IdleEffector>();
    parts_.planner =
        arm::MotionPlanner::Create("ur3e", arm::MotionLimits(), calibration::Calibration()).value();
    parts_.journal =
        session::Journal::Open(folder_.Path("rig.db"), session::Journal::Mode::kCreateOrReadWrite).value();
    parts_.audit = audit::AuditLog::Open(folder_.Path("audit.jsonl")).value();
  }
  void Start() {
    if (arm_ == nullptr) MakeParts();
    RigOptions options;
    options.clock = &clock_;
    absl::StatusOr<std::unique_ptr<Rig>> rig = Rig::Create(options, std::move(parts_));
    ASSERT_TRUE(rig.ok()) << rig.status();
    rig_ = *std::move(rig);
  }
  void End() {
    rig_ = nullptr;
    arm_ = nullptr;
    parts_ = RigParts();
  }
  // A touch that a process before this one had under way.
  void JournalExecuting(uint32_t program_id) {
    session::JournalSession session;
    session.name = "monday";
    ASSERT_TRUE(parts_.journal->EnsureSession(session).ok());
    ASSERT_TRUE(parts_.journal->Begin("monday", "touch 7", "lat00", "+z", "command").ok());
    ASSERT_TRUE(parts_.journal->Executing("monday", "touch 7", program_id, 1).ok());
  }

  // What another thread does at once: the machine may be busy.
  static bool WaitFor(const std::function<bool()>& done) {
    for (const double until_s = SteadyClock().NowS() + 60; SteadyClock().NowS() < until_s;) {
      if (done()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }
  // Heartbeats and safety watch wait for the time: what they do now is done.
  void AwaitThreads() { clock_.AwaitWaiters(2); }
  // A whole look of the safety watch, where nobody else looks.
  void LetTheWatchLook() {
    AwaitThreads();
    clock_.AdvanceToFirst();
    AwaitThreads();
  }
  bool LatchedByTheWatch() {
    LetTheWatchLook();
    return !rig_->StopReason().empty();
  }
  // Lets time pass while a motion is under way whose supervisor asks this guard.
  absl::Status CountLook() {
    ++guards_;
    return absl::OkStatus();
  }
  void PassUnderSupervision(double seconds, const std::function<bool()>& over) {
    constexpr double kStepS = 0.1;  // far below what counts as a hang
    for (double passed_s = 0; passed_s < seconds && !over(); passed_s += kStepS) {
      const int guards = guards_;
      clock_.Advance(kStepS);
      ASSERT_TRUE(WaitFor([&] { return guards_ > guards + 1 || over(); }));
    }
  }
  absl::Status Home() {
    return rig_->Home([this] { return CountLook(); });
  }
  std::future<absl::Status> HomeLater() {
    return std::async(std::launch::async, [this] { return Home(); });
  }

  const TestFolder folder_;
  ManualClock clock_;
  std::atomic<int> guards_{0};
  RigParts parts_;
  ScriptedArm* arm_ = nullptr;
  std::unique_ptr<Rig> rig_;
};

TEST_F(RigLatch, AProtectiveStopLatchesHoweverShortItWas) {
  Start();
  LetTheWatchLook();
  arm_->SetSafety(SafetyMode::kProtectiveStop);
  arm_->SetSafety(SafetyMode::kNormal);
  ASSERT_TRUE(LatchedByTheWatch());
  EXPECT_THAT(rig_->StopReason(), HasSubstr("PROTECTIVE_STOP between motions"));
  const absl::Status refused = Home();
  EXPECT_EQ(refused.code(), absl::StatusCode::kAborted);
  EXPECT_THAT(std::string(refused.message()), AllOf(HasSubstr("PROTECTIVE_STOP"), HasSubstr("rig reset")));
  EXPECT_EQ(arm_->programs, 0);
  ASSERT_TRUE(rig_->Reset("looked", "ana").ok());
  EXPECT_EQ(rig_->StopReason(), "");
  // Once more is another stop.
  arm_->SetSafety(SafetyMode::kProtectiveStop);
  EXPECT_TRUE(LatchedByTheWatch());
}

TEST_F(RigLatch, WhatIsFoundAtTheStartLatchesAndOutlivesTheProcess) {
  for (const SafetyMode mode :
       {SafetyMode::kProtectiveStop, SafetyMode::kRobotEmergencyStop, SafetyMode::kSystemEmergencyStop,
        SafetyMode::kViolation, SafetyMode::kFault, SafetyMode::kRecovery}) {
    MakeParts();
    arm_->SetSafety(mode);
    Start();
    ASSERT_TRUE(LatchedByTheWatch());
    EXPECT_EQ(rig_->Reset("too early", "ana").code(), absl::StatusCode::kFailedPrecondition);
    End();
    Start();
    EXPECT_NE(rig_->StopReason(), "");
    EXPECT_EQ(Home().code(), absl::StatusCode::kAborted);
    EXPECT_TRUE(rig_->Reset("looked", "ana").ok());
    End();
  }
}

TEST_F(RigLatch, ASafeguardLatchesOnlyIfItInterruptedOrRefusedAMotion) {
  Start();
  arm_->SetSafety(SafetyMode::kSafeguardStop);
  LetTheWatchLook();
  arm_->SetSafety(SafetyMode::kNormal);
  LetTheWatchLook();
  EXPECT_EQ(rig_->StopReason(), "") << "somebody changed the object";

  arm_->SetSafety(SafetyMode::kSafeguardStop);
  const absl::Status refused = Home();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(rig_->StopReason(), HasSubstr("SAFEGUARD_STOP when a motion was asked for"));
  arm_->SetSafety(SafetyMode::kNormal);
  EXPECT_EQ(Home().code(), absl::StatusCode::kAborted) << "a retry moved the arm when the door closed";
  EXPECT_EQ(arm_->programs, 0);
  ASSERT_TRUE(rig_->Reset("nobody is inside", "ana").ok());

  auto homing = HomeLater();
  ASSERT_TRUE(WaitFor([&] { return arm_->motions == 1; }));
  arm_->SetSafety(SafetyMode::kSafeguardStop);
  EXPECT_EQ(homing.get().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(rig_->StopReason(), HasSubstr("SAFEGUARD_STOP during program"));
}

TEST_F(RigLatch, AProgramThatSomethingElseEndedLatches) {
  Start();
  auto homing = HomeLater();
  ASSERT_TRUE(WaitFor([&] { return arm_->motions == 1; }));
  // As after a trip of the watchdog, or "stop" at the teach pendant.
  arm_->Change([](ArmState* state) { state->runtime_state = RuntimeState::kStopped; });
  PassUnderSupervision(0.85, [] { return false; });
  EXPECT_EQ(rig_->StopReason(), "") << "its end is not certain yet";
  PassUnderSupervision(60,
                       [&] { return homing.wait_for(std::chrono::seconds(0)) == std::future_status::ready; });
  EXPECT_EQ(homing.get().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(rig_->StopReason(), AllOf(HasSubstr("ended during a motion"), HasSubstr("phase 'transit'")));
  EXPECT_EQ(Home().code(), absl::StatusCode::kAborted);
  EXPECT_EQ(arm_->programs, 1);
}

TEST_F(RigLatch, NothingGoesOutForAMotionFromBeforeAStopEvenIfItWasReset) {
  Start();
  for (const bool reset : {false, true}) {
    arm_->before_send = [&] {
      rig_->Stop("while the program was built", "ana");
      if (reset) {
        ASSERT_TRUE(rig_->Reset("a mistake", "ana").ok());
      }
    };
    EXPECT_EQ(Home().code(), absl::StatusCode::kAborted);
    EXPECT_EQ(arm_->programs, 0);
    EXPECT_TRUE(rig_->Reset("looked", "ana").ok());
  }
}

TEST_F(RigLatch, ASupervisorThatHangsLosesItsHeartbeats) {
  Start();
  std::atomic<bool> hang{false}, hangs{false};
  auto homing = std::async(std::launch::async, [&] {
    return rig_->Home([&] {
      hangs = hang.load();
      while (hang) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return absl::OkStatus();
    });
  });
  // The motion ends with the test, also where an assertion ends it.
  const absl::Cleanup end = [&] {
    hang = false;
    rig_->Stop("the test is over", "ana");
  };
  ASSERT_TRUE(WaitFor([&] { return arm_->motions == 1; }));
  // They come while it moves, for longer than one permit.
  for (double passed_s = 0; passed_s < 2 * Heartbeats::kPermitS; passed_s += Heartbeats::kPeriodS) {
    AwaitThreads();
    const int heartbeats = arm_->heartbeats;
    clock_.Advance(Heartbeats::kPeriodS);
    ASSERT_TRUE(WaitFor([&] { return arm_->heartbeats > heartbeats; })) << passed_s << " s later";
  }
  hang = true;
  ASSERT_TRUE(WaitFor([&] { return hangs.load(); }));
  AwaitThreads();
  clock_.Advance(Heartbeats::kPermitS);
  AwaitThreads();
  const int heartbeats = arm_->heartbeats;
  for (double passed_s = 0; passed_s < 2 * Heartbeats::kPermitS; passed_s += Heartbeats::kPeriodS) {
    clock_.Advance(Heartbeats::kPeriodS);
    AwaitThreads();
    EXPECT_EQ(arm_->heartbeats, heartbeats) << passed_s << " s later";
  }
  hang = false;
  rig_->Stop("enough", "ana");
  EXPECT_FALSE(homing.get().ok());
}

TEST_F(RigLatch, AMotionThatFailedAfterAHangLatchesAndOneThatFailedInTimeDoesNot) {
  Start();
  for (const double hang_s : {0.0, 0.3, 0.6}) {
    const int motions = arm_->motions;
    const absl::Status lost = rig_->Home([&]() -> absl::Status {
      if (arm_->motions == motions) return absl::OkStatus();
      clock_.Advance(hang_s);
      return absl::AbortedError("the lease was lost");
    });
    EXPECT_EQ(lost.code(), absl::StatusCode::kAborted);
    if (hang_s < 0.5)
      EXPECT_EQ(rig_->StopReason(), "");
    else
      EXPECT_THAT(rig_->StopReason(), HasSubstr("it hung for 0.6 s during a motion"));
  }
}

// --- Whatever ended a motion that this gateway did not end itself

TEST_F(RigLatch, ALinkThatWasLostDuringAMotionLatchesAndBeforeItDoesNot) {
  Start();
  arm_->before_send = [&] { arm_->SetLink(absl::UnavailableError("the link is down")); };
  EXPECT_FALSE(Home().ok());
  EXPECT_EQ(rig_->StopReason(), "") << "what was not let go waited at rest";
  EXPECT_EQ(arm_->motions, 0);
  arm_->before_send = nullptr;
  arm_->SetLink(absl::OkStatus());
  auto homing = HomeLater();
  ASSERT_TRUE(WaitFor([&] { return arm_->motions == 1; }));
  arm_->SetLink(absl::UnavailableError("the link is down"));
  ASSERT_TRUE(WaitFor([&] { return !rig_->StopReason().empty(); }));
  arm_->SetLink(absl::OkStatus());
  EXPECT_EQ(homing.get().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(rig_->StopReason(),
              AllOf(HasSubstr("the loss of the arm's controller"), HasSubstr("during a motion")));
  EXPECT_EQ(Home().code(), absl::StatusCode::kAborted);
}

TEST_F(RigLatch, APausedProgramLatchesHoweverSoonItGoesOnAndIsEndedIfItStaysPaused) {
  Start();
  auto homing = HomeLater();
  ASSERT_TRUE(WaitFor([&] { return arm_->motions == 1; }));
  arm_->Change([](ArmState* state) { state->runtime_state = RuntimeState::kPausing; });
  arm_->Change([](ArmState* state) { state->runtime_state = RuntimeState::kPlaying; });
  EXPECT_EQ(homing.get().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(rig_->StopReason(), HasSubstr("was paused during a motion"));

  // As a safety function leaves it: somebody could go on with it at the pendant.
  arm_->Change([](ArmState* state) { state->runtime_state = RuntimeState::kPaused; });
  const int stops = arm_->stops;
  for (int look = 0; look < 4; ++look) LetTheWatchLook();  // the heartbeats' thread still takes turns with it
  EXPECT_EQ(arm_->stops, stops + 1) << "one stop ends the program";
}

TEST_F(RigLatch, AGatewayThatIsToldToEndLatchesIfSomethingMoved) {
  Start();
  rig_->Close();
  EXPECT_EQ(rig_->StopReason(), "");
  EXPECT_EQ(Home().code(), absl::StatusCode::kUnavailable);
  End();
  Start();
  auto homing = HomeLater();
  ASSERT_TRUE(WaitFor([&] { return arm_->motions == 1; }));
  rig_->Close();
  EXPECT_FALSE(homing.get().ok());
  EXPECT_THAT(rig_->StopReason(), HasSubstr("the gateway was told to end"));
  End();
  Start();
  EXPECT_THAT(rig_->StopReason(), HasSubstr("the gateway was told to end"));
}

TEST_F(RigLatch, AStopIsNamedBeforeItStopsAnything) {
  Start();
  std::string told;  // what a motion that the stop ends at once says
  arm_->on_stop = [&] { told = rig_->StopReason(); };
  rig_->Stop("Bo's cable", "ana");
  EXPECT_EQ(told, "by ana (Bo's cable)");
  EXPECT_THAT(rig_->StopReason(), HasSubstr("by ana (Bo's cable) at "));
}

TEST_F(RigLatch, AProgramOfSomebodyElseEndsAMotionAndLatches) {
  Start();
  auto homing = HomeLater();
  ASSERT_TRUE(WaitFor([&] { return arm_->motions == 1; }));
  arm_->BeginForeign("swing");
  PassUnderSupervision(60,
                       [&] { return homing.wait_for(std::chrono::seconds(0)) == std::future_status::ready; });
  EXPECT_EQ(homing.get().code(), absl::StatusCode::kAborted);
  EXPECT_THAT(rig_->StopReason(), HasSubstr("the program 'swing'"));
  EXPECT_GE(arm_->stops, 1);
}

TEST_F(RigLatch, APowerUpThatWasUnderWayLatchesInTheNextProcess) {
  MakeParts();
  ASSERT_TRUE(parts_.journal->SetMetadata("motion_under_way", "0 powering the arm on").ok());
  Start();
  EXPECT_THAT(rig_->StopReason(), HasSubstr("powering the arm on was under way when the gateway ended"));
}

// --- Stops

TEST_F(RigLatch, AStopThatIsNotHeededIsSentAnotherWayAndElseNotConfirmed) {
  for (const bool heeds_other : {true, false}) {
    Start();
    arm_->SetProgram(9, MotionPhase::kTransit, RuntimeState::kPlaying);
    arm_->heeds_stops = false, arm_->heeds_other_stops = heeds_other;
    auto stopping = std::async(std::launch::async, [&] { return rig_->Stop("a test", "ana"); });
    const auto ended = [&] {
      return stopping.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    };
    while (!ended()) {
      clock_.Advance(0.05);
      arm_->Change([](ArmState* state) { state->joints_rad[0] += 1e-4; });
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    const StopOutcome outcome = stopping.get();
    EXPECT_EQ(outcome.standstill.ok(), heeds_other) << outcome.standstill;
    EXPECT_EQ(arm_->other_stops, 1);
    if (!heeds_other) {
      EXPECT_THAT(
          std::string(outcome.standstill.message()),
          AllOf(HasSubstr("NOT CONFIRMED"), HasSubstr("a program runs on"), HasSubstr("emergency stop")));
    }
    EXPECT_THAT(rig_->StopReason(), HasSubstr("by ana (a test)"));
    End();
  }
}

TEST_F(RigLatch, OneStateAfterAGapConfirmsNoStandstill) {
  Start();
  arm_->SetProgram(9, MotionPhase::kTransit, RuntimeState::kPlaying);
  arm_->heeds_stops = arm_->heeds_other_stops = false;
  auto stopping = std::async(std::launch::async, [&] { return rig_->Stop("a test", "ana"); });
  ASSERT_TRUE(WaitFor([&] { return arm_->stops == 1; }));
  // Whenever it is looked at, there is one state since long, and the arm was elsewhere in the one before.
  while (stopping.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    clock_.Advance(0.05);
    arm_->Change([](ArmState* state) {
      state->runtime_state = RuntimeState::kStopped;
      state->controller_time_s += 0.06;
      state->joints_rad[0] += 0.01;
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_THAT(std::string(stopping.get().standstill.message()),
              AllOf(HasSubstr("NOT CONFIRMED"), HasSubstr("the arm still moves")));
}

TEST_F(RigLatch, AnArmThatIsPressedAtRestDoesNotBeginToMove) {
  Start();
  arm_->Pass(0.3);
  arm_->Change([](ArmState* state) { state->tip_force_n = {0, 0, -14}; });
  arm_->Pass(0.3);
  const absl::Status refused = Home();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("feels 14.0 N"));
  EXPECT_EQ(arm_->programs, 0);
}

// Every program zeroes the sensor: what is felt before it, noise or a payload that is a little wrong, must not add up.
TEST_F(RigLatch, WhatIsZeroedByManyProgramsDoesNotAddUp) {
  Start();
  arm_->arrives = true;
  arm_->while_prepared = [](ArmState* state) { state->tip_force_n.setZero(); };
  for (int k = 0; k < 30; ++k) {
    arm_->Change([](ArmState* state) { state->tip_force_n = {0, 0, -1}; });
    arm_->Pass(0.3);
    const absl::Status home = Home();
    ASSERT_TRUE(home.ok()) << k << ": " << home;
  }
}

// --- What a process before this one left

TEST_F(RigLatch, ATouchThatWasUnderWayLatchesWithWhereTheArmStands) {
  MakeParts();
  JournalExecuting(7);
  arm_->SetProgram(7, MotionPhase::kApproach, RuntimeState::kStopped);
  Start();
  EXPECT_THAT(rig_->StopReason(),
              AllOf(HasSubstr("touch 'touch 7' of session 'monday', program 7"), HasSubstr("had been ended"),
                    HasSubstr("phase 'approach'"), HasSubstr("NORMAL"), HasSubstr("the tip stands at")));
  EXPECT_EQ(arm_->stops, 0) << "nothing ran";
  EXPECT_EQ(Home().code(), absl::StatusCode::kAborted);
}

TEST_F(RigLatch, AProgramThatStillRunsIsStoppedAndLatches) {
  MakeParts();
  JournalExecuting(7);
  arm_->SetProgram(7, MotionPhase::kApproach, RuntimeState::kPlaying);
  Start();
  EXPECT_GE(arm_->stops, 1);
  EXPECT_THAT(rig_->StopReason(), HasSubstr("ran on and was stopped"));
}

TEST_F(RigLatch, AProgramThatCameToItsEndOrNeverBeganNeedsNobody) {
  for (const auto& [id, phase] : {std::pair(7, MotionPhase::kDone), std::pair(6, MotionPhase::kDone)}) {
    MakeParts();
    JournalExecuting(7);
    arm_->SetProgram(id, phase, RuntimeState::kStopped);
    Start();
    EXPECT_EQ(rig_->StopReason(), "");
    EXPECT_EQ(arm_->stops, 0);
    End();
  }
}

TEST_F(RigLatch, AMotionWithoutATouchIsFoundTooAndOnlyOnce) {
  MakeParts();
  ASSERT_TRUE(parts_.journal->SetMetadata("motion_under_way", "9 a motion without a touch").ok());
  arm_->SetProgram(9, MotionPhase::kTransit, RuntimeState::kStopped);
  Start();
  EXPECT_THAT(rig_->StopReason(), HasSubstr("a motion without a touch, program 9"));
  ASSERT_TRUE(rig_->Reset("looked", "ana").ok());
  End();
  MakeParts();
  arm_->SetProgram(9, MotionPhase::kTransit, RuntimeState::kStopped);
  Start();
  EXPECT_EQ(rig_->StopReason(), "");
}

}  // namespace
}  // namespace touchstone::gateway
