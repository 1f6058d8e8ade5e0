// What differs between the series of controllers: e-Series, and CB3 where TOUCHSTONE_TEST_ARM is ur3.
#include <gmock/gmock.h>

#include "tests/physical/safety_fixture.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

class Series : public Safety {};

TEST_F(Series, IsTheOneThatTheTestsWereStartedFor) {
  StartRig([](rig::EmulatorOptions* options) { options->speedup = 1; });
  EXPECT_EQ(emulator_->options().arm, Cb3() ? "ur3" : "ur3e");
  StartGateway();
  EXPECT_EQ(RigState().arm().model(), Cb3() ? "ur3" : "ur3e");
  WaitUntil([&] { return RigState().arm().rate_hz() > (Cb3() ? 100 : 400); }, "states come at the full rate");
  EXPECT_LT(RigState().arm().rate_hz(), Cb3() ? 130 : 510);
}

TEST_F(Series, InLocalControlNothingMovesAndThatIsSaid) {
  if (Cb3()) GTEST_SKIP() << "a CB3 controller knows no local control";
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  emulator_->faults().Set("local_control", 1);
  const Answer answer = Touch(lease.token(), FromAbove(), "local");
  EXPECT_FALSE(answer.status.ok());
  EXPECT_THAT(answer.status.error_message(), HasSubstr("remote control"));
  EXPECT_EQ(emulator_->controller().Count("motions"), 0u);
  emulator_->faults().Set("local_control", 0);
  ExpectTheTouchCanBeMade(FromAbove(), "local");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Series, PowerOnInLocalControlIsRefusedAndWorksOnceRemoteControlIsOn) {
  if (Cb3()) GTEST_SKIP() << "a CB3 controller knows no local control";
  StartRig([](rig::EmulatorOptions* options) { options->powered = false; });
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  emulator_->faults().Set("local_control", 1);
  const grpc::Status refused = PowerOn(lease.token());
  EXPECT_FALSE(refused.ok());
  EXPECT_THAT(refused.error_message(), HasSubstr("Remote Control"));
  emulator_->faults().Set("local_control", 0);
  const grpc::Status powered = PowerOn(lease.token());
  EXPECT_TRUE(powered.ok()) << powered.error_message();
}

}  // namespace
}  // namespace touchstone
