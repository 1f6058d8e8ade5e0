// The six points of a scripted rig's safety, each provoked. After every one: nothing lost, nothing doubled,
// nothing attributed to another pose.
#include <gmock/gmock.h>

#include "tests/physical/safety_fixture.h"

namespace touchstone {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

// --- 1. One writer

TEST_F(Safety, ASecondWriterIsRefusedAndAStaleOneToo) {
  StartRig();
  StartGateway();
  KeptLease first(control_.get(), "first", true);
  KeptLease second(control_.get(), "second", false);
  EXPECT_EQ(second.status().error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(second.status().error_message(), HasSubstr("first"));
  EXPECT_EQ(Touch("", FromAbove(), "without a lease").status.error_code(), grpc::FAILED_PRECONDITION);
  const uint64_t programs = emulator_->controller().Count("programs");
  KeptLease third(control_.get(), "third", true);
  EXPECT_EQ(Touch(first.token(), FromAbove(), "stale").status.error_code(), grpc::ABORTED);
  EXPECT_EQ(emulator_->controller().Count("programs"), programs) << "a stale writer moved the arm";
  EXPECT_TRUE(Touch(third.token(), FromAbove(), "fresh").status.ok());
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Safety, TakingTheLeaseStopsTheMotionOfTheOneBefore) {
  StartRig();
  StartGateway();
  KeptLease first(control_.get(), "first", true);
  auto touch = TouchLater(first.token(), FromAbove(kSlow), "interrupted");
  WaitUntilApproaching();
  KeptLease second(control_.get(), "second", true);
  EXPECT_EQ(touch.get().status.error_code(), grpc::ABORTED);
  WaitForRest();
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "interrupted");
  ExpectEveryResultIsItsOwnTouch();
}

// --- 2. A dead client, a dead gateway

TEST_F(Safety, ADeadClientsMotionStops) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "dies", true);
  lease.StopRenewing();
  auto touch = TouchLater(lease.token(), FromAbove(kSlow), "of a dead client");
  WaitUntilApproaching();
  lease_clock_.Advance(1.01 * lease.window_s());
  const Answer answer = touch.get();
  EXPECT_EQ(answer.status.error_code(), grpc::ABORTED) << answer.status.error_message();
  WaitForRest();
  EXPECT_LT(emulator_->touches(), 1u) << "it went on until contact";
  ExpectTheTouchCanBeMade(FromAbove(), "of another client");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Safety, AClientThatHangsUpStopsItsMotion) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "hangs up", true);
  v1::TouchRequest request;
  request.set_object("lat00");
  *request.add_touches() = FromAbove(kSlow);
  request.set_lease_token(lease.token());
  request.set_session("test");
  request.add_touch_ids("hung up");
  grpc::ClientContext context;
  auto call = std::async(std::launch::async, [&] {
    v1::TouchResponse response;
    return source_->Touch(&context, request, &response);
  });
  WaitUntilApproaching();
  context.TryCancel();
  EXPECT_EQ(call.get().error_code(), grpc::CANCELLED);
  WaitForRest();
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "hung up");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Safety, AKilledGatewaysArmIsStoppedByItsOwnWatchdogAndTheTouchIsReconciled) {
  StartRig();
  StartGatewayProcess();
  {
    KeptLease lease(control_.get(), "before", true);
    EXPECT_TRUE(Touch(lease.token(), FromAbove(0.02, 1), "before").status.ok());
    auto touch = TouchLater(lease.token(), FromAbove(0.0005), "killed");
    WaitUntilApproaching();
    KillGatewayProcess();
    EXPECT_FALSE(touch.get().status.ok());
  }
  WaitUntil([&] { return emulator_->controller().Count("watchdog_stops") > 0; },
            "the watchdog ends the program");
  WaitForRest();
  EXPECT_EQ(emulator_->controller().Count("protective_stops"), 0u);
  const auto before = Journalled();
  ASSERT_EQ(before.size(), 2u);
  EXPECT_EQ(before[1].stage, session::TouchStage::kExecuting)
      << "an interrupted touch is unknown until it is reconciled";

  // On a UR a watchdog ends the program and nothing else: no protective stop keeps the arm from moving again.
  const uint64_t motions = emulator_->controller().Count("motions");
  StartGatewayProcess();
  EXPECT_EQ(RigState().interrupted_touches(), 1u);
  EXPECT_EQ(emulator_->controller().Count("motions"), motions) << "it moved before anybody had asked it to";
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED) << "a person looks first";
  EXPECT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(0.0005), "killed");
  KillGatewayProcess();
  ExpectEveryResultIsItsOwnTouch();
}

// --- A frozen controller, an unplugged line, a protective stop

TEST_F(Safety, AFrozenControllerIsNoticed) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  auto touch = TouchLater(lease.token(), FromAbove(kSlow), "frozen");
  WaitUntilApproaching();
  emulator_->faults().Set("freeze", 2.5);
  const Answer answer = touch.get();
  EXPECT_EQ(answer.status.error_code(), grpc::UNAVAILABLE) << answer.status.error_message();
  WaitUntil([&] { return State() != v1::SOURCE_STATE_DISCONNECTED; }, "the controller is back");
  // It may have thawed with its watchdog overdue.
  WaitForRest();
  if (State() == v1::SOURCE_STATE_STOPPED) {
    EXPECT_TRUE(Reset().ok());
  }
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "frozen");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Safety, ALineThatIsUnpluggedInMidTouchStopsTheArm) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  auto touch = TouchLater(lease.token(), FromAbove(kSlow), "unplugged");
  WaitUntilApproaching();
  emulator_->faults().Set("unplug", 0.5);
  const Answer answer = touch.get();
  EXPECT_FALSE(answer.status.ok());
  EXPECT_THAT(answer.status.error_code(), AnyOf(grpc::UNAVAILABLE, grpc::DATA_LOSS))
      << answer.status.error_message();
  WaitForRest();
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "unplugged");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Safety, AProtectiveStopIsNeverUnlockedByItself) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  auto touch = TouchLater(lease.token(), FromAbove(kSlow), "stopped");
  WaitUntilApproaching();
  emulator_->faults().Set("protective_stop", 1);
  const Answer answer = touch.get();
  EXPECT_EQ(answer.status.error_code(), grpc::FAILED_PRECONDITION) << answer.status.error_message();
  EXPECT_THAT(answer.status.error_message(), HasSubstr("PROTECTIVE_STOP"));
  EXPECT_EQ(State(), v1::SOURCE_STATE_PROTECTIVE_STOP);
  for (int k = 0; k < 3; ++k) EXPECT_FALSE(Touch(lease.token(), FromAbove(), "more").status.ok());
  EXPECT_EQ(State(), v1::SOURCE_STATE_PROTECTIVE_STOP);
  UnlockByHand();
  EXPECT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "stopped");
  ExpectEveryResultIsItsOwnTouch();
}

// --- 3. Every motion is checked before it is sent

TEST_F(Safety, MotionsBeyondTheLimitsAreRefusedWithValueAndLimitAndNothingMoves) {
  StartRig();
  StartGateway({"--limits-box-max-mm", "500,500,400"});
  KeptLease lease(control_.get(), "client", true);
  ASSERT_TRUE(Touch(lease.token(), FromAbove(), "mounts the object").status.ok());
  const uint64_t programs = emulator_->controller().Count("programs");
  v1::CommandedTouch fast = FromAbove(0.5), far = FromAbove(), high = FromAbove(), aside = FromAbove();
  far.mutable_target_m()->set_x(0.9);
  high.set_standoff_m(0.14);
  high.mutable_target_m()->set_z(0.4);
  aside.mutable_approach()->set_z(0);
  aside.mutable_approach()->set_x(-1);
  aside.mutable_lateral()->set_x(0);
  aside.mutable_lateral()->set_y(1);
  for (const auto& [touch, words] :
       {std::pair(fast, "500"), std::pair(far, "touch"), std::pair(high, "box")}) {
    const Answer answer = Touch(lease.token(), touch, std::string("refused ") + words);
    EXPECT_THAT(answer.status.error_code(), AnyOf(grpc::OUT_OF_RANGE, grpc::INVALID_ARGUMENT))
        << answer.status.error_message();
    EXPECT_THAT(answer.status.error_message(), HasSubstr(words));
  }
  EXPECT_EQ(emulator_->controller().Count("programs"), programs);
  // A dry run says the same.
  v1::CheckTouchesRequest request;
  request.set_object("lat00");
  *request.add_touches() = FromAbove();
  *request.add_touches() = fast;
  *request.add_touches() = aside;
  v1::CheckTouchesResponse response;
  grpc::ClientContext context;
  ASSERT_TRUE(rig_->CheckTouches(&context, request, &response).ok());
  EXPECT_TRUE(response.checks(0).possible());
  EXPECT_FALSE(response.checks(1).possible());
  EXPECT_EQ(response.checks(2).up_face(), v1::UP_FACE_PLUS_X);
  EXPECT_EQ(emulator_->controller().Count("programs"), programs);
  StopGateway();
  EXPECT_EQ(Journalled().size(), 1u) << "what was refused is no touch";
}

// --- A finger that does not report, a speed that was scaled

TEST_F(Safety, AFingerThatIsPressedBeforehandIsNamed) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  ASSERT_TRUE(Touch(lease.token(), FromAbove(), "good").status.ok());
  emulator_->faults().Set("stuck_finger", 1);
  const Answer answer = Touch(lease.token(), FromAbove(), "stuck");
  EXPECT_FALSE(answer.status.ok());
  EXPECT_THAT(answer.status.error_message(), HasSubstr("finger"));
  emulator_->faults().Set("stuck_finger", -1);
  ExpectTheTouchCanBeMade(FromAbove(), "stuck");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Safety, AFingerThatSticksInMidApproachIsNamedAndItsTouchIsRefused) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  ASSERT_TRUE(Touch(lease.token(), FromAbove(), "good").status.ok());
  auto answer = TouchLater(lease.token(), FromAbove(0.02, 1), "sticks");
  WaitUntilApproaching();
  emulator_->faults().Set("stuck_finger", 1);
  const grpc::Status refused = answer.get().status;
  EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(refused.error_message(), HasSubstr("finger 2 is still pressed although the tool is back"));
  EXPECT_EQ(State(), v1::SOURCE_STATE_IDLE);
  emulator_->faults().Set("stuck_finger", -1);
  ExpectTheTouchCanBeMade(FromAbove(0.02, 1), "sticks");
  StopGateway();
  for (const session::JournalTouch& touch : Journalled())
    EXPECT_EQ(touch.stage, session::TouchStage::kDone) << touch.id << ": " << touch.error;
}

TEST_F(Safety, AFingerThatSticksAndFreesItselfInMidApproachIsNamedAndItsTouchIsRefused) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  ASSERT_TRUE(Touch(lease.token(), FromAbove(), "good").status.ok());
  auto answer = TouchLater(lease.token(), FromAbove(kSlow, 1), "sticks");
  WaitUntilApproaching();
  const auto reads = [this](bool pressed) {
    const v1::EffectorStatus effector = RigState().effector();
    return effector.pressed_size() == 3 && effector.pressed(1) == pressed;
  };
  emulator_->faults().Set("stuck_finger", 1);
  WaitUntil([&] { return reads(true); }, "the finger reads pressed");
  emulator_->faults().Set("stuck_finger", -1);
  WaitUntil([&] { return reads(false); }, "the finger reads free");
  ASSERT_EQ(RigState().arm().phase(), v1::MOTION_PHASE_APPROACH) << "it freed itself in mid-approach";
  const grpc::Status refused = answer.get().status;
  EXPECT_EQ(refused.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(refused.error_message(), HasSubstr("finger 2 let go"));
  EXPECT_THAT(refused.error_message(), HasSubstr("while the tool still approached"));
  EXPECT_EQ(State(), v1::SOURCE_STATE_IDLE);
  ExpectTheTouchCanBeMade(FromAbove(kSlow, 1), "sticks");
  StopGateway();
  for (const session::JournalTouch& touch : Journalled())
    EXPECT_EQ(touch.stage, session::TouchStage::kDone) << touch.id << ": " << touch.error;
}

TEST_F(Safety, AFingerThatStaysSilentEndsTheApproachBeforeTheOthersArePushedTooFar) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  emulator_->faults().Set("missing_finger", 2);
  const Answer answer = Touch(lease.token(), FromAbove(), "silent");
  ASSERT_TRUE(answer.status.ok()) << answer.status.error_message();
  EXPECT_FALSE(answer.response.results(0).complete());
  EXPECT_EQ(State(), v1::SOURCE_STATE_IDLE) << "the arm is in no protective stop";
  emulator_->faults().Set("missing_finger", -1);
  ExpectTheTouchCanBeMade(FromAbove(0.02, 1), "afterwards");
}

TEST_F(Safety, ATouchWhoseSpeedWasScaledIsNotTakenForOne) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  emulator_->faults().Set("speed_scaling", 0.5);
  const Answer answer = Touch(lease.token(), FromAbove(), "scaled");
  EXPECT_EQ(answer.status.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(answer.status.error_message(), HasSubstr("50 %"));
  emulator_->faults().Set("speed_scaling", 1);
  ExpectTheTouchCanBeMade(FromAbove(), "scaled");
}

}  // namespace
}  // namespace touchstone
