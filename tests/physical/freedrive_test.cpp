// The arm in a person's hands: what frees it, and everything that ends that.
#include <gmock/gmock.h>

#include "server/geometry/pose.h"
#include "server/session/recorded/base_pose.h"
#include "tests/physical/safety_fixture.h"
#include "touchstone/v1/freedrive.grpc.pb.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

class Freedrive : public Safety {
 protected:
  // One call of Guide; reads until it is told otherwise.
  struct Guided {
    Guided(const std::shared_ptr<grpc::Channel>& channel, const std::string& token)
        : stub(v1::Freedrive::NewStub(channel)) {
      v1::GuideRequest request;
      request.set_lease_token(token);
      stream = stub->Guide(&context, request);
    }
    bool Read() { return stream->Read(&state); }
    grpc::Status End() {
      context.TryCancel();
      return Finish();
    }
    grpc::Status Finish() {
      while (stream->Read(&state)) {
      }
      return stream->Finish();
    }
    grpc::ClientContext context;
    std::unique_ptr<v1::Freedrive::Stub> stub;
    std::unique_ptr<grpc::ClientReader<v1::GuideState>> stream;
    v1::GuideState state;
  };
  void ExpectHeld() {
    WaitUntil([&] { return !emulator_->controller().Free(); }, "the arm holds still");
    EXPECT_NE(emulator_->controller().MoveByHand({{0.1, -1.5, -1.5, -1.5, 1.5, 0}}), "");
  }
};

TEST_F(Freedrive, ReportsWhereAHandPutsTheToolInTheObjectsFrameOnBothSeries) {
  for (const std::string arm : {"ur3", "ur3e"}) {
    StartRig([&](rig::EmulatorOptions* options) { options->arm = arm; });
    StartGateway();
    KeptLease lease(control_.get(), "teacher", true);
    ASSERT_TRUE(Touch(lease.token(), FromAbove(), "mounts " + arm).status.ok());
    ExpectHeld();
    {
      Guided guided(channel_, lease.token());
      ASSERT_TRUE(guided.Read()) << arm << ": " << guided.Finish().error_message();
      EXPECT_EQ(guided.state.object(), "lat00");
      std::array<double, 6> joints{{0.2, -1.4, -1.2, -2.0, 1.5, 0.3}};
      ASSERT_EQ(emulator_->controller().MoveByHand(joints), "");
      const Eigen::Isometry3d there = emulator_->controller().BaseFromTip();
      WaitUntil(
          [&] {
            if (!guided.Read()) return false;
            const Eigen::Isometry3d told =
                geometry::PoseFromVector(session::ParseBasePose(guided.state.base_from_tip()));
            return (told.translation() - there.translation()).norm() < 1e-3;
          },
          "the new pose is reported");
      EXPECT_TRUE(guided.state.has_object_from_tip());
      EXPECT_EQ(guided.End().error_code(), grpc::CANCELLED);
    }
    ExpectHeld();
    // From where the hand left it, the rig works on.
    const Answer after = Touch(lease.token(), FromAbove(0.02, 1), "after " + arm);
    EXPECT_TRUE(after.status.ok()) << after.status.error_message();
    StopGateway();
    emulator_ = nullptr;
  }
}

TEST_F(Freedrive, NeedsALeaseAndNoStopAndEndsWithEither) {
  StartRig();
  StartGateway();
  Guided without(channel_, "");
  EXPECT_FALSE(without.Finish().ok());
  {
    KeptLease lease(control_.get(), "teacher", true);
    Guided guided(channel_, lease.token());
    ASSERT_TRUE(guided.Read());
    WaitUntil([&] { return emulator_->controller().Free(); }, "the arm is free");
    KeptLease other(control_.get(), "other", true);  // takes it
    EXPECT_FALSE(guided.Finish().ok());
    ExpectHeld();
  }
  KeptLease lease(control_.get(), "teacher", true);
  Guided guided(channel_, lease.token());
  ASSERT_TRUE(guided.Read());
  Stop("a test");
  EXPECT_EQ(guided.Finish().error_code(), grpc::ABORTED);
  ExpectHeld();
  Guided stopped(channel_, lease.token());
  const grpc::Status refused = stopped.Finish();
  EXPECT_EQ(refused.error_code(), grpc::ABORTED);
  EXPECT_THAT(refused.error_message(), HasSubstr("rig reset"));
}

TEST_F(Freedrive, EndsWithTheClientAndWithTheGateway) {
  StartRig();
  StartGatewayProcess();
  auto lease = std::make_unique<KeptLease>(control_.get(), "teacher", true);
  {
    Guided guided(channel_, lease->token());
    ASSERT_TRUE(guided.Read());
    WaitUntil([&] { return emulator_->controller().Free(); }, "the arm is free");
    guided.context.TryCancel();  // as a client that dies
    ExpectHeld();
  }
  Guided guided(channel_, lease->token());
  ASSERT_TRUE(guided.Read());
  WaitUntil([&] { return emulator_->controller().Free(); }, "the arm is free");
  KillGatewayProcess();
  ExpectHeld();
}

}  // namespace
}  // namespace touchstone
