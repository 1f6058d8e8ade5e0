// That data are what they are called: touches at the commanded speed, pictures from the commanded pose.
#include <gmock/gmock.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <set>

#include "tests/physical/physical_test.h"

namespace touchstone {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Truth : public PhysicalTest {
 protected:
  // From straight above lat00, so far to the side.
  static v1::View ViewFrom(double side_m, double height_m = 0.25) {
    v1::View view;
    v1::CameraPose* camera = view.mutable_camera();
    camera->mutable_eye_m()->set_x(side_m);
    camera->mutable_eye_m()->set_z(height_m);
    camera->mutable_at_m()->set_x(side_m);
    camera->mutable_up()->set_y(1);
    return view;
  }
  grpc::Status Capture(const std::string& token, const v1::View& view, v1::CaptureResponse* response) {
    v1::CaptureRequest request;
    request.set_object("lat00");
    request.set_lease_token(token);
    *request.add_views() = view;
    request.mutable_image()->set_width(64);
    request.mutable_image()->set_height(64);
    grpc::ClientContext context;
    return source_->Capture(&context, request, response);
  }
  void Mount(const std::string& token) {
    v1::MountObjectRequest request;
    request.set_object("lat00");
    request.set_lease_token(token);
    v1::RigState state;
    grpc::ClientContext context;
    const grpc::Status status = rig_->MountObject(&context, request, &state);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  void ExpectThere(const v1::CaptureResponse& response, const v1::View& view) {
    ASSERT_EQ(response.photographs_size(), 1);
    const v1::Photograph& photograph = response.photographs(0);
    EXPECT_LT(photograph.deviation_m(), 5e-4);
    EXPECT_LT(photograph.deviation_rad(), 2e-3);
    ASSERT_TRUE(photograph.has_measured());
    EXPECT_NEAR(photograph.measured().eye_m().x(), view.camera().eye_m().x(), 5e-4);
    EXPECT_NEAR(photograph.measured().eye_m().z(), view.camera().eye_m().z(), 5e-4);
    EXPECT_NEAR(photograph.measured().up().y(), 1, 1e-3);
    EXPECT_NEAR(photograph.unix_s(), static_cast<double>(std::time(nullptr)), 60);
    EXPECT_FALSE(emulator_->controller().Moving());
  }
};

TEST_F(Truth, ATouchWithTheSpeedSliderAtHalfIsRefusedWithBothNumbers) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  emulator_->faults().Set("speed_slider", 0.5);
  const Answer half = Touch(lease.token(), FromAbove(), "half");
  EXPECT_EQ(half.status.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(half.status.error_message(),
              AllOf(HasSubstr("slider stood at 50 %"), HasSubstr("limiter left 100 %")));
  emulator_->faults().Set("speed_slider", 1);
  emulator_->faults().Set("speed_scaling", 0.8);
  const Answer limited = Touch(lease.token(), FromAbove(), "limited");
  EXPECT_THAT(limited.status.error_message(),
              AllOf(HasSubstr("slider stood at 100 %"), HasSubstr("left 80 %")));
  emulator_->faults().Set("speed_scaling", 1);
  const Answer full = Touch(lease.token(), FromAbove(), "half");
  ASSERT_TRUE(full.status.ok()) << full.status.error_message();
  EXPECT_NEAR(full.response.results(0).measured().speed_m_s(), 0.02, 1e-4);
}

TEST_F(Truth, APictureAfterAFreshJournalIsTakenFromItsOwnPose) {
  StartRig();
  StartGateway();
  uint32_t last = 0;
  {
    KeptLease lease(control_.get(), "client", true);
    v1::CaptureResponse response;
    const grpc::Status status = Capture(lease.token(), ViewFrom(0.03), &response);
    ASSERT_TRUE(status.ok()) << status.error_message();
    ExpectThere(response, ViewFrom(0.03));
    last = RigState().arm().program_id();
  }
  EXPECT_GT(last, 0u);

  // The worst that a fresh journal can do: its first program has the id that stands in the registers, as done.
  StopGateway();
  for (const char* end : {"", "-wal", "-shm"})
    std::filesystem::remove(folder_.Path(std::string("rig/rig.db") + end));
  {
    const auto journal =
        session::Journal::Open(folder_.Path("rig/rig.db"), session::Journal::Mode::kCreateOrReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    ASSERT_TRUE((*journal)->SetMetadata("next_program_id", std::to_string(last)).ok());
  }
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  Mount(lease.token());
  v1::CaptureResponse response;
  const grpc::Status status = Capture(lease.token(), ViewFrom(-0.03), &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ExpectThere(response, ViewFrom(-0.03));
  EXPECT_NE(RigState().arm().program_id(), last);
}

TEST_F(Truth, TheSameViewCanBePhotographedAgain) {
  StartRig();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  for (int k = 0; k < 3; ++k) {
    v1::CaptureResponse response;
    const grpc::Status status = Capture(lease.token(), ViewFrom(0.03), &response);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
}

TEST_F(Truth, FreshJournalsBeginAtProgramIdsOfTheirOwn) {
  StartRig();
  std::set<uint32_t> ids;
  for (int k = 0; k < 3; ++k) {
    StartGateway();
    KeptLease lease(control_.get(), "client", true);
    Mount(lease.token());
    const Answer answer = Touch(lease.token(), FromAbove(), "first");
    ASSERT_TRUE(answer.status.ok()) << answer.status.error_message();
    ids.insert(RigState().arm().program_id());
    lease.StopRenewing();
    StopGateway();
    for (const char* end : {"", "-wal", "-shm"})
      std::filesystem::remove(folder_.Path(std::string("rig/rig.db") + end));
  }
  EXPECT_EQ(ids.size(), 3u);
}

TEST_F(Truth, APictureFromFartherOffThanTheToleranceIsRefused) {
  StartRig();
  StartGateway({"--camera-pose-tolerance-mm", "0.001"});
  KeptLease lease(control_.get(), "client", true);
  v1::CaptureResponse response;
  const grpc::Status status = Capture(lease.token(), ViewFrom(0.02), &response);
  EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION) << status.error_message();
  EXPECT_THAT(status.error_message(), AllOf(HasSubstr("0.001 mm"), HasSubstr("camera.pose_tolerance_mm")));
}

TEST_F(Truth, ViewsThatTheRigCannotTakeAreToldWithoutMotion) {
  StartRig();
  StartGateway();
  v1::CheckViewsRequest request;
  request.set_object("lat00");
  *request.add_views() = ViewFrom(0.02);
  *request.add_views() = ViewFrom(0.02, 1.5);
  *request.add_views() = ViewFrom(-0.02);
  v1::CheckTouchesResponse response;
  grpc::ClientContext context;
  const uint64_t programs = emulator_->controller().Count("programs");
  const grpc::Status status = rig_->CheckViews(&context, request, &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(response.checks_size(), 3);
  EXPECT_TRUE(response.checks(0).possible()) << response.checks(0).reason();
  EXPECT_FALSE(response.checks(1).possible());
  EXPECT_THAT(response.checks(1).reason(), HasSubstr("views[1]"));
  EXPECT_TRUE(response.checks(2).possible()) << response.checks(2).reason();
  EXPECT_EQ(emulator_->controller().Count("programs"), programs);
}

}  // namespace
}  // namespace touchstone
