// Stop, what releases it, and power: a stop holds whatever clients retry, until a person resets it.
#include <gmock/gmock.h>

#include <fstream>

#include "tests/physical/safety_fixture.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

TEST_F(Safety, StopDuringMotionNeedsNoLeaseAndHolds) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  auto touch = TouchLater(lease.token(), FromAbove(kSlow), "stopped");
  WaitUntilApproaching();
  auto waiting = TouchLater(lease.token(), FromAbove(0.02, 2), "queued");
  v1::StopRequest request;
  request.set_reason("a test");
  v1::StopResponse response;
  grpc::ClientContext context;
  ASSERT_TRUE(control_->Stop(&context, request, &response).ok());
  EXPECT_EQ(response.aborted_touches(), 1u);
  EXPECT_EQ(touch.get().status.error_code(), grpc::ABORTED);
  EXPECT_EQ(waiting.get().status.error_code(), grpc::ABORTED) << "what waits does not begin after a stop";
  WaitForRest();
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  EXPECT_EQ(Touch(lease.token(), FromAbove(), "after the stop").status.error_code(), grpc::ABORTED);
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  EXPECT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "stopped");
  ExpectEveryResultIsItsOwnTouch();
  std::ifstream audit(folder_.Path("rig/audit.jsonl"));
  const std::string log((std::istreambuf_iterator<char>(audit)), {});
  EXPECT_THAT(log, testing::AllOf(HasSubstr("\"stop\""), HasSubstr("a test"),
                                  HasSubstr("\"up_face\":\"+z\",\"lease_holder\":\"client\"")));
}

TEST_F(Safety, AClientThatRetriesDoesNotReleaseAStop) {
  StartRig();
  StartGateway();
  KeptLease first(control_.get(), "first", true);
  ASSERT_TRUE(Touch(first.token(), FromAbove(), "before").status.ok());
  Stop("cable caught");
  const uint64_t programs = emulator_->controller().Count("programs");
  std::string stale;
  for (int k = 0; k < 50; ++k) {
    KeptLease lease(control_.get(), "retries", true);
    ASSERT_TRUE(lease.status().ok()) << lease.status().error_message();
    const Answer answer = Touch(lease.token(), FromAbove(), "retried");
    ASSERT_EQ(answer.status.error_code(), grpc::ABORTED) << "try " << k;
    EXPECT_THAT(answer.status.error_message(),
                testing::AllOf(HasSubstr("cable caught"), HasSubstr("rig reset")));
    stale = lease.token();
  }
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  EXPECT_EQ(emulator_->controller().Count("programs"), programs) << "the arm moved after a stop";

  // Resetting moves nothing: whoever moves next asks for a lease after it.
  KeptLease held(control_.get(), "holds on", true);
  EXPECT_TRUE(Reset().ok());
  EXPECT_EQ(State(), v1::SOURCE_STATE_IDLE);
  EXPECT_EQ(Touch(held.token(), FromAbove(), "retried").status.error_code(), grpc::ABORTED);
  EXPECT_EQ(Touch(stale, FromAbove(), "retried").status.error_code(), grpc::ABORTED);
  EXPECT_EQ(emulator_->controller().Count("programs"), programs) << "the reset moved the arm";
  ExpectTheTouchCanBeMade(FromAbove(), "retried");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Safety, AStopOutlivesTheGateway) {
  StartRig();
  StartGatewayProcess();
  Stop("cable caught");
  KillGatewayProcess();
  StartGatewayProcess();
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  {
    KeptLease lease(control_.get(), "after the restart", true);
    EXPECT_EQ(Touch(lease.token(), FromAbove(), "touch").status.error_code(), grpc::ABORTED);
  }
  EXPECT_TRUE(Reset().ok());
  KillGatewayProcess();
  StartGatewayProcess();
  EXPECT_EQ(State(), v1::SOURCE_STATE_IDLE) << "a reset outlives the gateway too";
  KillGatewayProcess();
}

TEST_F(Safety, AStopHoldsWhileTheControllerItselfForbidsMotion) {
  StartRig();
  StartGateway();
  Stop("cable caught");
  emulator_->faults().Set("protective_stop", 1);
  WaitUntil([&] { return State() == v1::SOURCE_STATE_PROTECTIVE_STOP; },
            "the controller is in a protective stop");
  const grpc::Status refused = Reset();
  EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION) << refused.error_message();
  EXPECT_THAT(refused.error_message(), HasSubstr("PROTECTIVE_STOP"));
  UnlockByHand();
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED) << "unlocking the controller is no reset";
  EXPECT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(), "afterwards");
}

// --- Power

TEST_F(Safety, PowerOnNeedsALeaseAndNoStopAndReleasesTheBrakes) {
  StartRig([](rig::EmulatorOptions* options) { options->powered = false; });
  StartGateway();
  EXPECT_EQ(State(), v1::SOURCE_STATE_POWERED_OFF);
  EXPECT_EQ(PowerOn("").error_code(), grpc::FAILED_PRECONDITION);
  Stop("cable caught");
  {
    KeptLease lease(control_.get(), "client", true);
    const grpc::Status stopped = PowerOn(lease.token());
    EXPECT_EQ(stopped.error_code(), grpc::ABORTED) << stopped.error_message();
  }
  EXPECT_EQ(RigState().arm().robot_mode(), v1::ROBOT_MODE_POWER_OFF) << "a stop was overridden";
  EXPECT_TRUE(Reset().ok());
  KeptLease lease(control_.get(), "client", true);
  const grpc::Status powered = PowerOn(lease.token());
  EXPECT_TRUE(powered.ok()) << powered.error_message();
  EXPECT_EQ(RigState().arm().robot_mode(), v1::ROBOT_MODE_RUNNING);
  EXPECT_EQ(State(), v1::SOURCE_STATE_IDLE);

  emulator_->faults().Set("emergency_stop", 1);
  WaitUntil([&] { return State() == v1::SOURCE_STATE_EMERGENCY_STOP; }, "the emergency stop is pressed");
  const grpc::Status pressed = PowerOn(lease.token());
  EXPECT_EQ(pressed.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(pressed.error_message(), HasSubstr("release the emergency stop"));
}

TEST_F(Safety, AProgramThatWasJustSentDoesNotBeginAfterAStop) {
  StartRig();
  StartGateway();
  for (int k = 0; k < 10; ++k) {
    KeptLease lease(control_.get(), "client", true);
    const size_t commands = emulator_->controller().Commands().size();
    auto touch = TouchLater(lease.token(), FromAbove(), "race " + std::to_string(k));
    // Every other stop comes as soon as a program was sent, whenever this machine comes to that.
    if (k % 2 == 1)
      WaitUntil([&] { return emulator_->controller().Commands().size() > commands; }, "a program was sent");
    else
      std::this_thread::sleep_for(std::chrono::milliseconds(7 * k));
    v1::StopResponse response;
    grpc::ClientContext context;
    ASSERT_TRUE(control_->Stop(&context, {}, &response).ok());
    touch.get();
    WaitForRest();
    WaitForRigTime(2);
    EXPECT_FALSE(emulator_->controller().Moving()) << "it began after the stop, try " << k;
    // Nothing forbids it but that no state has come from the controller for a while; a person asks again.
    grpc::Status reset;
    WaitUntil([&] { return (reset = Reset()).error_code() != grpc::UNAVAILABLE; }, "the arm can be asked");
    ASSERT_TRUE(reset.ok()) << reset.error_message();
  }
  ExpectEveryResultIsItsOwnTouch();
}

}  // namespace
}  // namespace touchstone
