// The gateway's arm against the emulated controller, over real sockets, and what it does when
// the controller fails.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

#include "server/base/test_folder.h"
#include "server/gateway/arm/motion/motion_planner.h"
#include "server/gateway/arm/ur_arm.h"
#include "tests/rig/controller.h"
#include "tests/rig/controller/protocol/test_client.h"

namespace touchstone {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kPatienceS = 60;  // host time; the machine may be busy

// A heartbeat as the gateway gives it while something moves; the rig's time waits for it.
class Heart {
 public:
  Heart(gateway::arm::Arm* arm, rig::SimClock* clock)
      : thread_([this, arm, clock] {
          rig::SimClock::Part part(clock, nullptr);
          while (beating_) {
            const double now_s = clock->NowS();
            arm->SendHeartbeat();
            part.Done(now_s);
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
          }
        }) {}
  ~Heart() { Stop(); }
  void Stop() {
    beating_ = false;
    if (thread_.joinable()) thread_.join();
  }

 private:
  std::atomic<bool> beating_{true};
  std::thread thread_;
};

// An arm that is powered, at home, 120 mm of tool on its flange.
class EmulatedArm : public testing::Test {
 protected:
  explicit EmulatedArm(double speedup = 20, const std::string& model = "ur3e")
      : clock_(speedup, folder_.Path("clock")) {
    EXPECT_TRUE(gateway::timing::FollowClock(folder_.Path("clock")).ok());
    faults_.Follow(&clock_);
    options_.model = model;
    options_.powered = true;
    controller_ = rig::Controller::Start(options_, &clock_, &faults_, nullptr);
    gateway::arm::UrArmOptions arm;
    arm.model = model;
    arm.address = "127.0.0.1";
    arm.dashboard_port = controller_->ports().dashboard;
    arm.primary_port = controller_->ports().primary;
    arm.secondary_port = controller_->ports().secondary;
    arm.rtde_port = controller_->ports().rtde;
    arm.script.flange_from_tip.translation().z() = 0.12;
    arm.script.payload_kg = 0.7;
    arm.script.payload_cog_m = Eigen::Vector3d(0, 0.01, 0.045);
    arm.script.time_scale = speedup;
    // A busy machine's pauses are no dead gateway and no frozen controller.
    arm.script.watchdog_hz = 1;
    arm.frozen_after_s = 1;
    arm.program_start_s = 1.5;
    arm.connect_wait_s = kPatienceS;
    arm_options_ = arm;
    arm_ = gateway::arm::ConnectUrArm(arm, &changes_).value();
  }
  ~EmulatedArm() override {
    arm_ = nullptr;
    EXPECT_TRUE(gateway::timing::FollowClock("").ok());
  }

  template <typename Done>
  bool Wait(Done done) {
    const double until_s = rig::HostNowS() + kPatienceS;
    while (!done()) {
      if (rig::HostNowS() > until_s) return false;
      changes_.WaitForChange(changes_.count(), 0.01);
    }
    return true;
  }
  bool WaitForProgram(uint32_t program_id) {
    return Wait([&] {
      const auto state = arm_->State();
      return state.ok() && state->program_id == program_id;
    });
  }
  bool WaitForPhase(uint32_t program_id, gateway::arm::MotionPhase phase) {
    return Wait([&] {
      const auto state = arm_->State();
      return state.ok() && state->program_id == program_id && state->phase == phase;
    });
  }
  // A few steps straight down from above where the arm is.
  gateway::arm::ArmTouch SomeTouch(uint32_t program_id, double speed_m_s = 0.02) {
    Wait([&] { return arm_->State().ok(); });
    gateway::arm::ArmTouch touch;
    touch.program_id = program_id;
    Eigen::Isometry3d pose = arm_->State()->base_from_tip;
    pose.translation().z() += 0.03;
    touch.transit.push_back(pose);
    pose.translation().y() += 0.02;
    touch.transit.push_back(pose);
    touch.end = pose;
    touch.end.translation().z() -= 0.08;
    touch.speed_m_s = speed_m_s;
    return touch;
  }
  // Sends the program, and lets it go once it waits.
  absl::Status LetGo(uint32_t program_id, const absl::Status& sent) {
    if (!sent.ok()) return sent;
    if (!WaitForPhase(program_id, gateway::arm::MotionPhase::kNone))
      return absl::UnavailableError("the program does not wait to be let go");
    return arm_->BeginMotion(program_id);
  }
  absl::Status Start(const gateway::arm::ArmTouch& touch) {
    return LetGo(touch.program_id, arm_->StartTouch(touch));
  }
  void PassRigTime(double seconds) {
    const double until_s = clock_.NowS() + seconds;
    EXPECT_TRUE(Wait([&] { return clock_.NowS() >= until_s; }));
  }
  void ExpectAtRestSoon() {
    EXPECT_TRUE(Wait([&] { return !controller_->Moving(); }));
    const Eigen::Vector3d here = controller_->BaseFromTip().translation();
    PassRigTime(1);
    EXPECT_LT((controller_->BaseFromTip().translation() - here).norm(), 1e-6);
  }

  const TestFolder folder_;
  rig::SimClock clock_;
  rig::Faults faults_;
  rig::ControllerOptions options_;
  gateway::arm::UrArmOptions arm_options_;
  std::unique_ptr<rig::Controller> controller_;
  gateway::timing::ChangeNotifier changes_;
  std::unique_ptr<gateway::arm::UrArm> arm_;
};

TEST_F(EmulatedArm, TellsWhereTheTipIsBeforeAnyToolWasSet) {
  const auto state = arm_->State();
  ASSERT_TRUE(state.ok()) << state.status();
  const Eigen::Isometry3d truth = controller_->BaseFromFlange() * arm_options_.script.flange_from_tip;
  EXPECT_LT((state->base_from_tip.translation() - truth.translation()).norm(), 2e-4);
  EXPECT_EQ(state->robot_mode, gateway::arm::RobotMode::kRunning);
  EXPECT_TRUE(arm_->Ready().ok()) << arm_->Ready();
  EXPECT_FALSE(arm_->Version().empty());
}

TEST_F(EmulatedArm, TouchRunsThroughItsPhasesAndEndsWhereItBegan) {
  Heart heart(arm_.get(), &clock_);
  const gateway::arm::ArmTouch touch = SomeTouch(7);
  ASSERT_TRUE(Start(touch).ok());
  ASSERT_TRUE(WaitForPhase(7, gateway::arm::MotionPhase::kReady));
  EXPECT_LT((controller_->BaseFromTip().translation() - touch.transit.back().translation()).norm(), 1e-4);
  ASSERT_TRUE(arm_->BeginApproach(7).ok());
  ASSERT_TRUE(WaitForPhase(7, gateway::arm::MotionPhase::kDone));
  EXPECT_LT((controller_->BaseFromTip().translation() - touch.transit.back().translation()).norm(), 1e-4);

  // The history shows the approach: at its speed, down to its end.
  const double now_s = arm_->State()->controller_time_s;
  double lowest_m = 1, fastest_m_s = 0;
  for (const gateway::arm::ArmState& state : arm_->History(now_s - 30, now_s)) {
    if (state.phase != gateway::arm::MotionPhase::kApproach) continue;
    lowest_m = std::min(lowest_m, state.base_from_tip.translation().z());
    fastest_m_s = std::max(fastest_m_s, state.tip_velocity_m_s.norm());
  }
  EXPECT_NEAR(lowest_m, touch.end.translation().z(), 1e-3);
  EXPECT_NEAR(fastest_m_s, 0.02, 0.004);
}

TEST_F(EmulatedArm, ApproachEndsWhenItIsToldTo) {
  Heart heart(arm_.get(), &clock_);
  const gateway::arm::ArmTouch touch = SomeTouch(8, 0.002);
  ASSERT_TRUE(Start(touch).ok());
  ASSERT_TRUE(WaitForPhase(8, gateway::arm::MotionPhase::kReady));
  ASSERT_TRUE(arm_->BeginApproach(8).ok());
  ASSERT_TRUE(WaitForPhase(8, gateway::arm::MotionPhase::kApproach));
  ASSERT_TRUE(arm_->EndApproach(8).ok());
  ASSERT_TRUE(WaitForPhase(8, gateway::arm::MotionPhase::kDone));
  const double now_s = arm_->State()->controller_time_s;
  double lowest_m = 1;
  for (const gateway::arm::ArmState& state : arm_->History(now_s - 30, now_s))
    if (state.phase == gateway::arm::MotionPhase::kApproach)
      lowest_m = std::min(lowest_m, state.base_from_tip.translation().z());
  EXPECT_GT(lowest_m, touch.end.translation().z() + 0.01)
      << "it would have taken 40 s of the rig's to the end";
}

TEST_F(EmulatedArm, MovesThroughPosesToJoints) {
  Heart heart(arm_.get(), &clock_);
  const gateway::arm::ArmTouch touch = SomeTouch(9);
  gateway::arm::Joints joints = options_.joints_rad;
  joints[0] += 0.2;
  ASSERT_TRUE(LetGo(9, arm_->MoveThrough(9, touch.transit, {joints})).ok());
  ASSERT_TRUE(WaitForPhase(9, gateway::arm::MotionPhase::kDone));
  EXPECT_LT(gateway::arm::Farthest(arm_->State()->joints_rad, joints), 1e-3);
}

TEST_F(EmulatedArm, StopEndsAMotionAndTheNextOneRuns) {
  Heart heart(arm_.get(), &clock_);
  const gateway::arm::ArmTouch touch = SomeTouch(10, 0.002);
  ASSERT_TRUE(Start(touch).ok());
  ASSERT_TRUE(WaitForPhase(10, gateway::arm::MotionPhase::kReady));
  ASSERT_TRUE(arm_->BeginApproach(10).ok());
  ASSERT_TRUE(WaitForPhase(10, gateway::arm::MotionPhase::kApproach));
  ASSERT_TRUE(arm_->Stop().ok());
  ExpectAtRestSoon();
  EXPECT_EQ(arm_->State()->phase, gateway::arm::MotionPhase::kApproach) << "it tells how far it came";
  ASSERT_TRUE(Start(SomeTouch(11)).ok());
  EXPECT_TRUE(WaitForPhase(11, gateway::arm::MotionPhase::kReady));
}

TEST_F(EmulatedArm, ProgramSentJustBeforeAStopDoesNotBeginAfterIt) {
  Heart heart(arm_.get(), &clock_);
  for (uint32_t id = 20; id < 30; ++id) {
    const gateway::arm::ArmTouch touch = SomeTouch(id);
    ASSERT_TRUE(Wait([&] { return arm_->Ready().ok(); })) << arm_->Ready();
    std::thread starter([&] { arm_->StartTouch(touch).IgnoreError(); });
    if (id % 2 == 0)
      std::this_thread::sleep_for(std::chrono::microseconds(100 * (id - 20)));
    else
      starter.join();
    ASSERT_TRUE(arm_->Stop().ok());
    if (starter.joinable()) starter.join();
    // Started after the stop it may run; stopped again it must not.
    ASSERT_TRUE(arm_->Stop().ok());
    ExpectAtRestSoon();
    EXPECT_FALSE(controller_->Moving()) << id;
  }
}

TEST_F(EmulatedArm, ProgramThatIsStoppedAfterItsGuardHasAnsweredDoesNotRun) {
  Heart heart(arm_.get(), &clock_);
  const gateway::arm::ArmTouch touch = SomeTouch(31);
  // The thread that sends it was held up between the two, for longer than a stop waits.
  const auto guard = [&] {
    std::thread([&] { EXPECT_TRUE(arm_->Stop().ok()); }).join();
    return absl::OkStatus();
  };
  EXPECT_EQ(arm_->StartTouch(touch, guard).code(), absl::StatusCode::kAborted);
  ExpectAtRestSoon();
  // Nor does the arm wait for it to begin.
  PassRigTime(1.2 * arm_options_.program_start_s * clock_.speedup());
  EXPECT_TRUE(arm_->State().ok()) << arm_->State().status();
}

TEST_F(EmulatedArm, StopsWithoutTheStateLink) {
  Heart heart(arm_.get(), &clock_);
  ASSERT_TRUE(Start(SomeTouch(12)).ok());
  ASSERT_TRUE(WaitForProgram(12));
  // At rest it would be before the motion begins too.
  ASSERT_TRUE(Wait([&] { return controller_->Moving(); }));
  faults_.Set("disconnect", 1);
  // Whatever is up again first carries it.
  EXPECT_TRUE(Wait([&] { return arm_->Stop().ok(); }));
  ExpectAtRestSoon();
}

// What was sent moves nothing until it is let go: a network may deliver it at any time.
TEST_F(EmulatedArm, ProgramThatWasSentWaitsAtRestUntilItIsLetGo) {
  Heart heart(arm_.get(), &clock_);
  const gateway::arm::ArmTouch touch = SomeTouch(40);
  const uint64_t motions = controller_->Count("motions");
  ASSERT_TRUE(arm_->StartTouch(touch).ok());
  ASSERT_TRUE(WaitForPhase(40, gateway::arm::MotionPhase::kNone));
  PassRigTime(3);
  EXPECT_EQ(controller_->Count("motions"), motions);
  EXPECT_EQ(arm_->State()->runtime_state, gateway::arm::RuntimeState::kPlaying);
  ASSERT_TRUE(arm_->BeginMotion(40).ok());
  EXPECT_TRUE(WaitForPhase(40, gateway::arm::MotionPhase::kReady));
}

TEST_F(EmulatedArm, ProgramOfSomebodyElseIsToldWithItsNameAndOwnOnesAreNot) {
  Heart heart(arm_.get(), &clock_);
  ASSERT_TRUE(Start(SomeTouch(41)).ok());
  ASSERT_TRUE(WaitForPhase(41, gateway::arm::MotionPhase::kReady));
  ASSERT_TRUE(arm_->Stop().ok());
  ExpectAtRestSoon();
  EXPECT_EQ(arm_->Foreign().count, 0u);
  rig::TestClient other(controller_->ports().secondary);
  other.Send("def pick_and_place():\n  movej([0,-1.5,-1.5,-1.5,1.5,0])\nend\n");
  EXPECT_TRUE(Wait([&] { return arm_->Foreign().count == 1; }));
  EXPECT_EQ(arm_->Foreign().newest, "pick_and_place");
}

// The watchdog ends what does not heed the stop, for instance a controller that was switched to local control: no heartbeat
// goes out after it.
TEST_F(EmulatedArm, StopEndsTheHeartbeatsAtOnce) {
  Heart heart(arm_.get(), &clock_);
  ASSERT_TRUE(Start(SomeTouch(42, 0.001)).ok());
  ASSERT_TRUE(WaitForPhase(42, gateway::arm::MotionPhase::kReady));
  ASSERT_TRUE(arm_->BeginApproach(42).ok());
  ASSERT_TRUE(WaitForPhase(42, gateway::arm::MotionPhase::kApproach));
  faults_.Set("local_control", 1);
  ASSERT_TRUE(arm_->Stop().ok()) << "it was sent; the controller says nothing";
  EXPECT_TRUE(Wait([&] { return controller_->Count("watchdog_stops") > 0; }));
  ExpectAtRestSoon();
}

// Not the tool centre point, which a UR takes where a program does not name it.
TEST_F(EmulatedArm, ControllerGetsTheCentreOfGravityOfThePayload) {
  Heart heart(arm_.get(), &clock_);
  ASSERT_TRUE(arm_->StartTouch(SomeTouch(19)).ok());
  ASSERT_TRUE(WaitForProgram(19));
  rig::TouchClient state(controller_->ports().rtde, "payload,payload_cog");
  state.Next();
  rig::WireReader rest(state.rest);
  EXPECT_EQ(rest.Get<double>(), 0.7);
  EXPECT_EQ(rest.Get<double>(), 0);
  EXPECT_EQ(rest.Get<double>(), 0.01);
  EXPECT_EQ(rest.Get<double>(), 0.045);
}

TEST_F(EmulatedArm, WatchdogStopsItWhenNobodyBeats) {
  Heart heart(arm_.get(), &clock_);
  ASSERT_TRUE(Start(SomeTouch(13, 0.001)).ok());
  ASSERT_TRUE(WaitForPhase(13, gateway::arm::MotionPhase::kReady));
  ASSERT_TRUE(arm_->BeginApproach(13).ok());
  ASSERT_TRUE(WaitForPhase(13, gateway::arm::MotionPhase::kApproach));
  heart.Stop();
  EXPECT_TRUE(Wait([&] { return controller_->Count("watchdog_stops") > 0; }));
  ExpectAtRestSoon();
}

TEST_F(EmulatedArm, ProtectiveStopForbidsMotionInWordsAndIsNeverUnlocked) {
  Heart heart(arm_.get(), &clock_);
  ASSERT_TRUE(arm_->StartTouch(SomeTouch(14)).ok());
  faults_.Set("protective_stop", 1);
  ASSERT_TRUE(Wait([&] {
    return arm_->State().ok() && arm_->State()->safety_mode == gateway::arm::SafetyMode::kProtectiveStop;
  }));
  EXPECT_EQ(arm_->Ready().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(arm_->Ready().message()), HasSubstr("PROTECTIVE_STOP"));
  EXPECT_EQ(arm_->StartTouch(SomeTouch(15)).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(arm_->PowerOn([] { return absl::OkStatus(); }).code(), absl::StatusCode::kFailedPrecondition);
  PassRigTime(2);
  EXPECT_EQ(arm_->State()->safety_mode, gateway::arm::SafetyMode::kProtectiveStop);
}

TEST_F(EmulatedArm, FrozenControllerIsToldAsSuchAndComesBack) {
  faults_.Set("freeze", 1.3);
  ASSERT_TRUE(Wait([&] { return !arm_->State().ok(); }));
  EXPECT_EQ(arm_->State().status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(arm_->State().status().message()), HasSubstr("silent"));
  EXPECT_FALSE(arm_->Ready().ok());
  EXPECT_TRUE(Wait([&] { return arm_->Ready().ok(); })) << arm_->Ready();
}

TEST_F(EmulatedArm, ConnectsAgainAfterEveryConnectionWasClosed) {
  const double before_s = arm_->State()->controller_time_s;
  faults_.Set("disconnect", 1);
  ASSERT_TRUE(Wait([&] { return !arm_->State().ok(); }));
  ASSERT_TRUE(Wait([&] { return arm_->Ready().ok(); })) << arm_->Ready();
  EXPECT_TRUE(Wait([&] {
    const auto state = arm_->State();
    return state.ok() && state->controller_time_s > before_s;
  }));
  Heart heart(arm_.get(), &clock_);
  ASSERT_TRUE(Start(SomeTouch(16)).ok());
  EXPECT_TRUE(WaitForPhase(16, gateway::arm::MotionPhase::kReady));
}

TEST_F(EmulatedArm, ClockOfTheControllerIsToldInHostTime) {
  ASSERT_TRUE(
      Wait([&] { return arm_->ControllerClock().valid && arm_->StateRateHz() > 200 / clock_.speedup(); }));
  const gateway::arm::ArmState state = *arm_->State();
  const double told_s = arm_->ControllerClock().RemoteOf(state.host_time_s);
  EXPECT_NEAR(told_s, state.controller_time_s, 1.0) << "not later than a busy machine delivers it";
}

// UR, RTDE guide (article 22229): registers 24 to 47 came with 5.3.0 and 3.9.0; before, they are NOT_FOUND.
TEST_F(EmulatedArm, SoftwareWithoutItsRegistersIsNamedWithItsVersionAndWhatWouldBeRight) {
  arm_ = nullptr;
  faults_.Set("old_software", 1);
  arm_options_.connect_wait_s = 0.5;
  arm_ = gateway::arm::ConnectUrArm(arm_options_, &changes_).value();
  EXPECT_TRUE(Wait([&] { return absl::IsFailedPrecondition(arm_->State().status()); }))
      << arm_->State().status();
  EXPECT_THAT(std::string(arm_->State().status().message()),
              AllOf(HasSubstr("output_int_register_24: NOT_FOUND"), HasSubstr("5.3.0 (e-Series): update"),
                    HasSubstr("its software is 5.2.0.61336")));
  faults_.Set("old_software", 0);
  EXPECT_TRUE(Wait([&] { return arm_->State().ok(); })) << "connects again by itself";
}

// An arm without power.
class UnpoweredArm : public testing::Test {
 protected:
  static constexpr double kSpeedup = 20;
  UnpoweredArm() {
    rig::ControllerOptions options;
    options.model = "ur3";
    controller_ = rig::Controller::Start(options, &clock_, &faults_, nullptr);
    gateway::arm::UrArmOptions arm;
    arm.model = "ur3";
    arm.address = "127.0.0.1";
    arm.dashboard_port = controller_->ports().dashboard;
    arm.primary_port = controller_->ports().primary;
    arm.secondary_port = controller_->ports().secondary;
    arm.rtde_port = controller_->ports().rtde;
    arm.script.time_scale = kSpeedup;
    // As for the other tests: a busy machine's pauses are no frozen controller.
    arm.frozen_after_s = 3;
    arm.program_start_s = 10;
    arm.connect_wait_s = kPatienceS;
    arm_ = gateway::arm::ConnectUrArm(arm, &changes_).value();
  }
  void Await(const std::function<bool(const absl::StatusOr<gateway::arm::ArmState>&)>& wanted) {
    const double until_s = gateway::timing::HostNowS() + kPatienceS;
    while (gateway::timing::HostNowS() < until_s) {
      const uint64_t seen = changes_.count();
      if (wanted(arm_->State())) return;
      changes_.WaitForChange(seen, 0.02);
    }
    FAIL() << arm_->State().status();
  }
  bool Boots() {
    const auto state = arm_->State();
    return state.ok() && state->robot_mode == gateway::arm::RobotMode::kBooting;
  }

  rig::SimClock clock_{kSpeedup};
  rig::Faults faults_;
  std::unique_ptr<rig::Controller> controller_;
  gateway::timing::ChangeNotifier changes_;
  std::unique_ptr<gateway::arm::UrArm> arm_;
};

TEST_F(UnpoweredArm, IsPoweredOnAndReleasesItsBrakes) {
  EXPECT_EQ(arm_->Ready().code(), absl::StatusCode::kFailedPrecondition) << arm_->Ready();
  EXPECT_THAT(std::string(arm_->Ready().message()), HasSubstr("POWER_OFF"));
  const absl::Status powered = arm_->PowerOn([] { return absl::OkStatus(); });
  EXPECT_TRUE(powered.ok()) << powered;
  EXPECT_TRUE(arm_->Ready().ok()) << arm_->Ready();
}

// "power on" is valid from POWER_OFF alone (docs.ros.org, ur_robot_driver: robot modes).
TEST_F(UnpoweredArm, IsNotToldToPowerOnWhileItsControllerBoots) {
  // Once more where a busy machine was connected again only after it had booted.
  do {
    faults_.Set("power_cut", 0.05);
    Await([](const auto& state) { return !state.ok(); });
    Await([](const auto& state) { return state.ok(); });
  } while (!Boots());
  const absl::Status powered = arm_->PowerOn([] { return absl::OkStatus(); });
  EXPECT_TRUE(powered.ok()) << powered;
  EXPECT_THAT(controller_->Commands(), ElementsAre("power on", "brake release"));
}

// Without a program that compiles nothing starts, and the error says what the controller said.
TEST_F(EmulatedArm, ProgramThatDoesNotCompileIsToldAsSuch) {
  gateway::arm::ArmTouch touch = SomeTouch(17);
  touch.end.translation().x() = std::numeric_limits<double>::quiet_NaN();  // "nan" is no number of URScript
  ASSERT_TRUE(arm_->StartTouch(touch).ok());
  ASSERT_TRUE(Wait([&] { return !arm_->State().ok(); }));
  EXPECT_THAT(std::string(arm_->State().status().message()), HasSubstr("did not begin program 17"));
  ASSERT_TRUE(arm_->Stop().ok());
  EXPECT_TRUE(arm_->State().ok()) << "a stop clears it";
}

}  // namespace
}  // namespace touchstone
