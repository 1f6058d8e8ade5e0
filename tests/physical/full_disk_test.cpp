// A disk that is full while the rig touches. The emulated rig's data stand for no measurement.
#include <gmock/gmock.h>

#include "server/base/files/full_disk.h"
#include "tests/physical/physical_test.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

class FullDiskTest : public PhysicalTest {
 protected:
  static constexpr double kSlow = 0.005;  // 50 mm in more than a second of the host's

  void Start() {
    StartRig([](rig::EmulatorOptions* options) { options->speedup = 8; });
    StartGateway();
    lease_ = std::make_unique<KeptLease>(control_.get(), "full disk", true);
    ASSERT_TRUE(Touch(lease_->token(), FromAbove(), "first").status.ok());
  }
  uint64_t Programs() { return emulator_->controller().Count("programs"); }

  std::unique_ptr<KeptLease> lease_;
};

TEST_F(FullDiskTest, RefusesATouchThatCannotBeWrittenDownAndTheIdIsFreeAfterwards) {
  Start();
  const uint64_t programs = Programs();
  {
    const FullDisk full;
    const Answer refused = Touch(lease_->token(), FromAbove(0.02, 1), "a");
    EXPECT_EQ(refused.status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED)
        << refused.status.error_message();
    EXPECT_THAT(refused.status.error_message(), HasSubstr("make room"));
  }
  EXPECT_EQ(Programs(), programs) << "nothing moves that is not on the disk";
  EXPECT_TRUE(Touch(lease_->token(), FromAbove(0.02, 1), "a").status.ok());
}

TEST_F(FullDiskTest, KeepsAResultUntilThereIsSpaceAndDoesNotTouchAgain) {
  Start();
  auto touching = TouchLater(lease_->token(), FromAbove(kSlow, 1), "a");
  WaitUntilApproaching();
  {
    const FullDisk full;
    const Answer answer = touching.get();
    EXPECT_EQ(answer.status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED)
        << answer.status.error_message();
    EXPECT_THAT(answer.status.error_message(),
                HasSubstr("was made, but its result could not be written down"));
    const Answer again = Touch(lease_->token(), FromAbove(kSlow, 1), "a");
    EXPECT_EQ(again.status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED)
        << again.status.error_message();
  }
  const uint64_t touches = emulator_->touches();
  const Answer answer = Touch(lease_->token(), FromAbove(kSlow, 1), "a");
  EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
  EXPECT_EQ(emulator_->touches(), touches) << "the result was there: nothing is touched again";
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(FullDiskTest, ATouchThatFailsOnAFullDiskCanBeMadeAgainUnderItsId) {
  Start();
  auto touching = TouchLater(lease_->token(), FromAbove(kSlow, 1), "a");
  WaitUntilApproaching();
  {
    const FullDisk full;
    grpc::ClientContext context;
    v1::StopResponse stopped;
    ASSERT_TRUE(control_->Stop(&context, {}, &stopped).ok());
    EXPECT_FALSE(touching.get().status.ok());
  }
  EXPECT_FALSE(Touch(lease_->token(), FromAbove(kSlow, 1), "a").status.ok()) << "the stop holds";
  ASSERT_TRUE(Reset().ok());
  lease_ = std::make_unique<KeptLease>(control_.get(), "full disk", true);
  const Answer answer = Touch(lease_->token(), FromAbove(kSlow, 1), "a");
  EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(FullDiskTest, AStopOnAFullDiskHoldsAndIsWrittenDownLater) {
  Start();
  {
    const FullDisk full;
    grpc::ClientContext context;
    v1::StopResponse stopped;
    ASSERT_TRUE(control_->Stop(&context, {}, &stopped).ok());
  }
  lease_ = nullptr;
  StopGateway();  // writes what it could not
  StartGateway();
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
}

}  // namespace
}  // namespace touchstone
