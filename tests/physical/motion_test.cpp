// Motions: the force guard, the way home, an arm with a calibration of its own, speeds that make no sense.
#include <gmock/gmock.h>

#include <cmath>

#include <Eigen/Core>

#include "tests/physical/safety_fixture.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

class Motion : public Safety {
 protected:
  grpc::Status Home(const std::string& token) {
    v1::HomeRequest request;
    request.set_lease_token(token);
    v1::RigState state;
    grpc::ClientContext context;
    return rig_->Home(&context, request, &state);
  }
  // Touches of lat00 that turn and lean every way, on three of its faces.
  v1::CommandedTouch Leaning(int which) const {
    const double lean = 0.45 * (which % 3) / 2, towards = 1.3 * which, roll = 0.9 * which;
    v1::CommandedTouch touch = FromAbove();
    touch.mutable_target_m()->set_x(0.02 * std::cos(towards));
    touch.mutable_approach()->set_x(std::sin(lean) * std::cos(towards));
    touch.mutable_approach()->set_y(std::sin(lean) * std::sin(towards));
    touch.mutable_approach()->set_z(-std::cos(lean));
    // The fingers' direction, perpendicular to the approach.
    const Eigen::Vector3d along(touch.approach().x(), touch.approach().y(), touch.approach().z());
    Eigen::Vector3d lateral(std::cos(roll), std::sin(roll), 0);
    lateral = (lateral - lateral.dot(along) * along).normalized();
    touch.mutable_lateral()->set_x(lateral.x());
    touch.mutable_lateral()->set_y(lateral.y());
    touch.mutable_lateral()->set_z(lateral.z());
    // Another face up: x -> y -> z -> x.
    for (int turn = 0; turn < which % 4 % 3; ++turn)
      for (v1::Vector3* v : {touch.mutable_target_m(), touch.mutable_approach(), touch.mutable_lateral()}) {
        const double x = v->x();
        v->set_x(v->z()), v->set_z(v->y()), v->set_y(x);
      }
    return touch;
  }
};

TEST_F(Motion, ForceBeyondTheLimitStopsTheTouchAndIsToldWithTheLimit) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  ASSERT_TRUE(Touch(lease.token(), FromAbove(), "light").status.ok());
  // The first finger is pushed into the object while another says nothing.
  ASSERT_EQ(emulator_->faults().Set("missing_finger", 1), "");
  ASSERT_EQ(emulator_->faults().Set("finger_stiffness", 5), "");
  const Answer pressed = Touch(lease.token(), FromAbove(), "pressed");
  EXPECT_EQ(pressed.status.error_code(), grpc::FAILED_PRECONDITION) << pressed.status.error_message();
  EXPECT_THAT(pressed.status.error_message(),
              testing::AllOf(HasSubstr("the approach pressed with "), HasSubstr(" N on the tip"),
                             HasSubstr("at most 25.0 N (limits.max_force_n)")));
  WaitForRest();
  const v1::Vector3 felt = RigState().arm().tip_force_n();
  EXPECT_GT(std::hypot(felt.x(), felt.y(), felt.z()), 20) << "the status tells what is felt";
  EXPECT_EQ(emulator_->controller().Count("protective_stops"), 0u)
      << "it was stopped before the arm stopped itself";

  // Away from what it presses against, it may go, though the program that takes it there zeroes the sensor while it presses.
  const grpc::Status home = Home(lease.token());
  EXPECT_TRUE(home.ok()) << home.error_message();
  emulator_->faults().Set("missing_finger", -1);
  emulator_->faults().Set("finger_stiffness", 0.05);
  ExpectTheTouchCanBeMade(FromAbove(), "pressed");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Motion, APayloadThatIsSetALittleWrongTripsNoForceGuard) {
  StartRig();
  ASSERT_EQ(emulator_->faults().Set("force_offset_n", 8), "");
  StartGateway({"--limits-max-force-n", "20"});
  KeptLease lease(control_.get(), "client", true);
  const Answer answer = Touch(lease.token(), FromAbove(), "offset");
  EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
}

TEST_F(Motion, ThereIsAWayHomeFromEveryTouchOnBothArms) {
  for (const std::string arm : {"ur3", "ur3e"}) {
    // A journal of its own: the other rig's motions are not under way here.
    StartRig([&](rig::EmulatorOptions* options) {
      options->arm = arm;
      options->dir = folder_.Path("rig " + arm);
    });
    StartGateway();
    KeptLease lease(control_.get(), "client", true);
    for (int which = 0; which < 12; ++which) {
      const Answer answer = Touch(lease.token(), Leaning(which), arm + std::to_string(which));
      ASSERT_TRUE(answer.status.ok()) << arm << " " << which << ": " << answer.status.error_message();
      const grpc::Status home = Home(lease.token());
      ASSERT_TRUE(home.ok()) << arm << " " << which << ": " << home.error_message();
    }
    // And from a stop in mid-approach.
    auto touch = TouchLater(lease.token(), FromAbove(kSlow), "stopped");
    WaitUntilApproaching();
    Stop("a test");
    EXPECT_FALSE(touch.get().status.ok());
    WaitForRest();
    ASSERT_TRUE(Reset().ok());
    KeptLease after(control_.get(), "afterwards", true);
    const grpc::Status home = Home(after.token());
    EXPECT_TRUE(home.ok()) << arm << ": " << home.error_message();
    StopGateway();
    emulator_ = nullptr;
  }
}

// What the controller sends of its arm is planned with: otherwise tips and joints would not fit each other.
TEST_F(Motion, AnArmWithACalibrationOfItsOwnIsPlannedWithIt) {
  StartRig([](rig::EmulatorOptions* options) { options->calibrated = true; });
  StartGateway();
  WaitUntil([this] { return RigState().arm().calibrated_kinematics(); }, "the arm's kinematics have come");
  KeptLease lease(control_.get(), "client", true);
  for (int which = 0; which < 4; ++which) {
    const Answer answer = Touch(lease.token(), Leaning(which), std::to_string(which));
    ASSERT_TRUE(answer.status.ok()) << answer.status.error_message();
  }
  EXPECT_TRUE(Home(lease.token()).ok());
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Motion, SpeedsOfNothingAreRefusedWithTheLeast) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  const Answer answer = Touch(lease.token(), FromAbove(1e-9), "never ends");
  EXPECT_EQ(answer.status.error_code(), grpc::OUT_OF_RANGE);
  EXPECT_THAT(answer.status.error_message(), HasSubstr("must be from 0.1 to 100 mm/s"));
}

}  // namespace
}  // namespace touchstone
