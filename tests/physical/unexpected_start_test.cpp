// Every way in which an arm could begin to move without a person: server/gateway/README.md has the table. In none of them
// does it: the rig is latched, and whatever retries is refused until a person's reset.
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>

#include "server/base/test_tier.h"
#include "tests/physical/latch_fixture.h"
#include "tests/rig/controller/protocol/test_client.h"

namespace touchstone {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;

class UnexpectedStart : public Latch {
 protected:
  // A program of somebody else, over the interface that anybody on the network can use. Whoever hangs up with states unread
  // before it was taken resets the connection, and the program is lost.
  void SendForeign(const std::string& program) {
    const size_t commands = CommandCount();
    rig::TestClient somebody(emulator_->controller().ports().secondary);
    somebody.Send(program);
    WaitUntil(
        [&] {
          const std::vector<std::string> since = CommandsSince(commands);
          return std::find(since.begin(), since.end(), "program swing") != since.end();
        },
        "the controller has the program");
  }
  // Whatever the touch became: nothing moves any more, and nothing that retries changes that.
  void ExpectLatchedAndAtRest(const std::string& because) {
    WaitUntil([&] { return !StopReason().empty(); }, "the rig latches");
    WaitForRest();
    const uint64_t motions = emulator_->controller().Count("motions");
    ExpectNothingMovesUntilReset(because);
    EXPECT_EQ(emulator_->controller().Count("motions"), motions);
  }
  // The arm itself: the second of the two programs that a stop sends may begin later, and moves nothing.
  void ExpectThatItStands() {
    const Eigen::Isometry3d before = emulator_->controller().BaseFromTip();
    WaitForRigTime(0.5);
    EXPECT_LT((emulator_->controller().BaseFromTip().translation() - before.translation()).norm(), 1e-9);
  }
  void ExpectResetAndPowerLetItMove(const std::string& id, double which = 0) {
    grpc::Status reset;
    WaitUntil([&] { return (reset = Reset()).ok(); }, "a person resets");
    {
      KeptLease lease(control_.get(), "a person", true);
      const grpc::Status powered = PowerOn(lease.token());
      EXPECT_TRUE(powered.ok()) << powered.error_message();
    }
    ExpectTheTouchCanBeMade(FromAbove(QuickMS(), which), id);
  }
};

// --- Power

TEST_F(UnexpectedStart, AnArmThatIsOffIsNotPoweredOnByAMotion) {
  StartRig([](rig::EmulatorOptions* options) { options->powered = false; });
  StartGateway();
  const size_t commands = CommandCount();
  KeptLease lease(control_.get(), "client", true);
  v1::HomeRequest home;
  home.set_lease_token(lease.token());
  v1::RigState rig;
  grpc::ClientContext context;
  for (const grpc::Status& refused :
       {Touch(lease.token(), FromAbove(), "off").status, rig_->Home(&context, home, &rig)}) {
    EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION);
    EXPECT_THAT(refused.error_message(), AllOf(HasSubstr("POWER_OFF"), HasSubstr("rig power-on")));
  }
  EXPECT_EQ(CommandCount(), commands);
  EXPECT_EQ(StopReason(), "") << "nothing happened that a person should look at";
  ASSERT_TRUE(PowerOn(lease.token()).ok());
  EXPECT_TRUE(Touch(lease.token(), FromAbove(QuickMS()), "on").status.ok());
}

TEST_F(UnexpectedStart, PowerOffAtThePendantBetweenTwoTouchesIsNotUndone) {
  StartRig();
  StartGateway();
  {
    KeptLease lease(control_.get(), "client", true);
    ASSERT_TRUE(Touch(lease.token(), FromAbove(QuickMS()), "before").status.ok());
    SendToDashboard("power off\n");
    ExpectLatchedAndAtRest("POWER_OFF");
  }
  EXPECT_EQ(RigState().arm().robot_mode(), v1::ROBOT_MODE_POWER_OFF);
  ExpectResetAndPowerLetItMove("after", 1);
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(UnexpectedStart, APowerCutOfTheControllerIsNotUndone) {
  StartRig();
  StartGateway();
  for (const double cut_s : {0.1, 1.0}) {
    const std::string id = "before " + std::to_string(cut_s);
    {
      KeptLease lease(control_.get(), "client", true);
      const Answer before = Touch(lease.token(), FromAbove(QuickMS()), id);
      ASSERT_TRUE(before.status.ok()) << before.status.error_message();
    }
    emulator_->faults().Set("power_cut", cut_s);
    WaitUntil([&] { return State() == v1::SOURCE_STATE_DISCONNECTED; }, "the controller is gone");
    WaitUntil([&] { return State() != v1::SOURCE_STATE_DISCONNECTED; }, "the controller is back");
    ExpectLatchedAndAtRest("the controller, whose arm was running, was started anew");
    // It still boots: "power on" is valid from POWER_OFF alone.
    ExpectResetAndPowerLetItMove("after " + std::to_string(cut_s), 1);
  }
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(UnexpectedStart, AGatewayThatIsKilledWhilePoweringUpLeavesItToAPerson) {
  StartRig([](rig::EmulatorOptions* options) { options->powered = false; });
  StartGatewayProcess();
  const size_t commands = CommandCount();
  auto powering = std::async(std::launch::async, [&] {
    v1::AcquireLeaseRequest request;
    request.set_holder("client");
    v1::Lease lease;
    grpc::ClientContext context;
    control_->AcquireLease(&context, request, &lease);
    return PowerOn(lease.token());
  });
  WaitUntil([&] { return CommandCount() > commands; }, "the arm is told to power on");
  KillGatewayProcess();
  EXPECT_FALSE(powering.get().ok());
  StartGatewayProcess();
  ExpectLatchedAndAtRest("powering the arm on was under way when the gateway ended");
  KillGatewayProcess();
}

// --- Safety functions

TEST_F(UnexpectedStart, ASafetyModeThatEndedAMotionLatchesWhateverItsNumber) {
  StartRig();
  StartGateway();
  // Of each kind one, and one that nobody knows; every number is gone through in gateway_rig_test (ArmWatchTest).
  const std::vector<int> modes =
      SecondTierRuns() ? std::vector<int>{4, 5, 8, 9, 10, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 42}
                       : std::vector<int>{5, 12, 13, 11, 42};
  for (const int mode : modes) {
    {
      KeptLease lease(control_.get(), "client", true);
      const uint32_t before = RigState().arm().program_id();
      auto touch = TouchLater(lease.token(), FromAbove(kSlow), "mode " + std::to_string(mode));
      WaitUntilApproachingAfter(before);
      emulator_->faults().Set("safety_mode", mode);
      EXPECT_EQ(touch.get().status.error_code(), grpc::FAILED_PRECONDITION) << mode;
    }
    emulator_->faults().Set("safety_mode", 1);
    WaitUntil([&] { return State() == v1::SOURCE_STATE_STOPPED; }, "the safety mode is normal again");
    // The program that the safety function had paused is ended, so that nobody goes on with it at the pendant.
    WaitUntil([&] { return !emulator_->controller().ProgramRuns(); }, "the paused program is ended");
    ExpectLatchedAndAtRest("during program");
    grpc::Status reset;
    WaitUntil([&] { return (reset = Reset()).ok(); }, "a person resets");
  }
  ExpectTheTouchCanBeMade(FromAbove(QuickMS()), "afterwards");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(UnexpectedStart, APauseAtThePendantEndsTheMotionAndItsTouchIsNotStored) {
  StartRig();
  StartGateway();
  for (const char* where : {"transit", "approach"}) {
    {
      KeptLease lease(control_.get(), "client", true);
      const uint32_t before = RigState().arm().program_id();
      auto touch = TouchLater(lease.token(), FromAbove(kSlow), where);
      if (std::string(where) == "approach")
        WaitUntilApproachingAfter(before);
      else
        WaitUntil([&] { return RigState().arm().phase() == v1::MOTION_PHASE_TRANSIT; }, "the arm moves");
      SendToDashboard("pause\n");
      // However soon somebody goes on with it.
      SendToDashboard("play\n");
      const Answer answer = touch.get();
      EXPECT_EQ(answer.status.error_code(), grpc::FAILED_PRECONDITION) << answer.status.error_message();
      EXPECT_THAT(answer.status.error_message(), HasSubstr("was paused during"));
    }
    ExpectLatchedAndAtRest("was paused during");
    ASSERT_TRUE(Reset().ok());
  }
  ExpectEveryResultIsItsOwnTouch();
}

// --- Networks

TEST_F(UnexpectedStart, ANetworkThatWasGoneLatchesIfItEndedAMotionHoweverLongItWasGone) {
  StartRig();
  StartGateway();
  int ended = 0, lasted = 0;
  const std::vector<double> cuts_s =
      SecondTierRuns() ? std::vector<double>{0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1, 1.2, 1.6, 2, 3, 5}
                       : std::vector<double>{0.05, 1.2, 2};
  for (size_t k = 0; k < cuts_s.size(); ++k) {
    const std::string id = "cut " + std::to_string(cuts_s[k]);
    Answer answer;
    {
      KeptLease lease(control_.get(), "client", true);
      const uint32_t before = RigState().arm().program_id();
      auto touch = TouchLater(lease.token(), FromAbove(kSlow), id);
      WaitUntilApproachingAfter(before);
      emulator_->faults().Set("network", cuts_s[k]);
      answer = touch.get();
    }
    WaitUntil([&] { return State() != v1::SOURCE_STATE_DISCONNECTED; }, "the link is back");
    if (answer.status.ok()) {
      ++lasted;
      EXPECT_EQ(StopReason(), "") << "nothing was interrupted by " << id;
      continue;
    }
    ++ended;
    ExpectLatchedAndAtRest("controller");
    grpc::Status reset;
    WaitUntil([&] { return (reset = Reset()).ok(); }, "a person resets");
    ExpectTheTouchCanBeMade(FromAbove(kSlow), id);
  }
  EXPECT_GE(ended, 2);
  EXPECT_GE(lasted, 1);
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(UnexpectedStart, AGatewayThatIsToldToEndDuringAMotionLeavesALatch) {
  StartRig();
  StartGatewayProcess();
  {
    KeptLease lease(control_.get(), "client", true);
    auto touch = TouchLater(lease.token(), FromAbove(kSlow), "ended");
    WaitUntilApproaching();
    ASSERT_EQ(kill(gateway_process(), SIGTERM), 0);
    EXPECT_FALSE(touch.get().status.ok());
  }
  WaitForRest();
  AwaitGatewayProcess();
  StartGatewayProcess();
  ExpectLatchedAndAtRest("the gateway was told to end");
  EXPECT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "ended");
  KillGatewayProcess();
  ExpectEveryResultIsItsOwnTouch();
}

// --- Programs of others

TEST_F(UnexpectedStart, AForeignProgramIsStoppedDuringAMotionAndLatchesAtAnyTime) {
  StartRig();
  StartGateway();
  const std::string endless =
      "def swing():\n  while True:\n    movej([0.2,-1.6,-1.6,-1.6,1.5,0], a=0.1, v=0.05)\n"
      "    movej([0,-1.5,-1.5,-1.5,1.5,0], a=0.1, v=0.05)\n  end\nend\n";
  {
    KeptLease lease(control_.get(), "client", true);
    auto touch = TouchLater(lease.token(), FromAbove(kSlow), "replaced");
    WaitUntilApproaching();
    SendForeign(endless);
    EXPECT_FALSE(touch.get().status.ok());
  }
  ExpectLatchedAndAtRest("the program 'swing', which is not this gateway's");
  EXPECT_FALSE(emulator_->controller().ProgramRuns()) << "what interfered with a motion is stopped with it";
  ASSERT_TRUE(Reset().ok());

  // Between motions it is left alone: it may be a person's at the pendant. Nothing of ours ends it.
  SendForeign(endless);
  WaitUntil([&] { return !StopReason().empty(); }, "the rig latches");
  EXPECT_TRUE(emulator_->controller().ProgramRuns());
  ExpectNothingMovesUntilReset("the program 'swing'");
  EXPECT_TRUE(emulator_->controller().ProgramRuns());
  // Nor does a motion that is asked for after a reset take the controller away from it.
  ASSERT_TRUE(Reset().ok());
  {
    KeptLease lease(control_.get(), "client", true);
    const Answer refused = Touch(lease.token(), FromAbove(), "beside it");
    EXPECT_THAT(refused.status.error_code(), AnyOf(grpc::FAILED_PRECONDITION, grpc::ABORTED));
    EXPECT_THAT(refused.status.error_message(), HasSubstr("program"));
  }
  EXPECT_TRUE(emulator_->controller().ProgramRuns());
  SendToDashboard("stop\n");
  WaitForRest();
  ASSERT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "replaced");
  ExpectEveryResultIsItsOwnTouch();
}

// --- Stop

TEST_F(UnexpectedStart, AStopThatTheControllerIgnoresIsConfirmedOnlyOnceTheArmStands) {
  if (Cb3()) GTEST_SKIP() << "a CB3 knows no local control";
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  auto touch = TouchLater(lease.token(), FromAbove(0.0005), "in local control");
  WaitUntilApproaching();
  emulator_->faults().Set("local_control", 1);
  v1::StopRequest request;
  request.set_reason("a test");
  v1::StopResponse response;
  grpc::ClientContext context;
  ASSERT_TRUE(control_->Stop(&context, request, &response).ok());
  if (response.standstill())
    ExpectThatItStands();  // the watchdog had ended it before this was said
  else
    EXPECT_THAT(response.not_confirmed(), AllOf(HasSubstr("NOT CONFIRMED"), HasSubstr("emergency stop")));
  EXPECT_FALSE(touch.get().status.ok());
  WaitForRest();
}

TEST_F(UnexpectedStart, AStopOfAMotionIsConfirmedByStandstill) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  auto touch = TouchLater(lease.token(), FromAbove(kSlow), "stopped");
  WaitUntilApproaching();
  v1::StopRequest request;
  v1::StopResponse response;
  grpc::ClientContext context;
  ASSERT_TRUE(control_->Stop(&context, request, &response).ok());
  EXPECT_TRUE(response.standstill()) << response.not_confirmed();
  ExpectThatItStands();
  EXPECT_FALSE(touch.get().status.ok());
}

// --- Force

TEST_F(UnexpectedStart, APayloadThatIsSetWrongIsNoticedBeforeAnythingMoves) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  for (const double offset_n : {12.0, 20.0, 30.0}) {
    emulator_->faults().Set("force_offset_n", offset_n);
    WaitUntil([&] { return std::abs(RigState().arm().tip_force_n().z()) > 11.6; }, "the arm feels it");
    WaitForRigTime(1);  // longer than the force at rest is averaged over
    const uint64_t motions = emulator_->controller().Count("motions");
    const Answer refused = Touch(lease.token(), FromAbove(), "heavy");
    EXPECT_EQ(refused.status.error_code(), grpc::FAILED_PRECONDITION) << offset_n;
    EXPECT_THAT(refused.status.error_message(), AllOf(HasSubstr("at rest"), HasSubstr("payload_kg")));
    EXPECT_EQ(emulator_->controller().Count("motions"), motions) << offset_n;
  }
  emulator_->faults().Set("force_offset_n", 0);
  WaitUntil([&] { return std::abs(RigState().arm().tip_force_n().z()) < 5; }, "the arm feels nothing");
  WaitForRigTime(1);
  EXPECT_TRUE(Touch(lease.token(), FromAbove(QuickMS()), "heavy").status.ok());
}

}  // namespace
}  // namespace touchstone
