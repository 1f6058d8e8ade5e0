// Photographs of a gateway: kept with what an image set needs before the client hears of them, whatever breaks. The
// emulated rig's data stand for no measurement.
#include <gmock/gmock.h>

#include <cmath>

#include "server/base/files/full_disk.h"
#include "server/base/units.h"
#include "server/service/sessions/stored_session.h"
#include "server/session/images/emulated.h"
#include "server/session/images/image_set_file.h"
#include "tests/physical/physical_test.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

constexpr char kSession[] = "default";  // pictures name no session
constexpr int kWidth = 96, kHeight = 72;

class GatewayPhotographs : public PhysicalTest {
 protected:
  void StartEmulator() {
    StartRig([](rig::EmulatorOptions* options) {
      options->camera_width = kWidth, options->camera_height = kHeight;
    });
  }
  struct Picture {
    grpc::Status status;
    v1::CaptureResponse response;
  };
  // From straight above lat00, so far to the side.
  Picture Capture(const std::string& token, double side_m) {
    v1::CameraPose camera;
    camera.mutable_eye_m()->set_x(side_m);
    camera.mutable_eye_m()->set_z(0.25);
    camera.mutable_at_m()->set_x(side_m);
    camera.mutable_up()->set_y(1);
    return Capture(token, camera);
  }
  Picture Capture(const std::string& token, const v1::CameraPose& camera) {
    v1::CaptureRequest request;
    request.set_object("lat00");
    request.set_lease_token(token);
    *request.add_views()->mutable_camera() = camera;
    request.mutable_image()->set_width(kWidth);
    request.mutable_image()->set_height(kHeight);
    Picture picture;
    grpc::ClientContext context;
    picture.status = source_->Capture(&context, request, &picture.response);
    return picture;
  }
  // As touchstone session export fetches it.
  absl::StatusOr<service::StoredSession> Export() {
    v1::ExportSessionRequest request;
    request.set_name(kSession);
    grpc::ClientContext context;
    const auto sessions = v1::Sessions::NewStub(channel_);
    const auto reader = sessions->ExportSession(&context, request);
    v1::ExportSessionResponse response;
    service::SessionPieces pieces;
    absl::Status wrong;
    while (wrong.ok() && reader->Read(&response)) wrong = pieces.Append(response.file(), response.csv());
    const grpc::Status finished = reader->Finish();
    if (!wrong.ok()) return wrong;
    if (!finished.ok()) return absl::UnknownError(finished.error_message());
    auto bytes = pieces.Take();
    if (!bytes.ok()) return bytes.status();
    return service::UnpackSession(*bytes);
  }
  v1::Session Describe() {
    v1::GetSessionRequest request;
    request.set_name(kSession);
    v1::Session session;
    grpc::ClientContext context;
    const grpc::Status status = v1::Sessions::NewStub(channel_)->GetSession(&context, request, &session);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return session;
  }
  // Of the journal itself, which a gateway may have open.
  uint64_t Kept() const {
    const auto journal =
        session::Journal::Open(folder_.Path("rig/rig.db"), session::Journal::Mode::kReadOnly);
    EXPECT_TRUE(journal.ok()) << journal.status();
    const auto session = (*journal)->Session(kSession);
    EXPECT_TRUE(session.ok()) << session.status();
    return session.ok() ? session->images : 0;
  }
};

TEST_F(GatewayPhotographs, ThatWereAcknowledgedOutliveAKilledGatewayAndAreAnImageSet) {
  StartEmulator();
  StartGatewayProcess();
  std::vector<v1::CaptureResponse> taken;
  {
    KeptLease lease(control_.get(), "client", true);
    const Picture picture = Capture(lease.token(), 0);
    ASSERT_TRUE(picture.status.ok()) << picture.status.error_message();
    taken.push_back(picture.response);
    lease.StopRenewing();
    KillGatewayProcess();
    EXPECT_EQ(Kept(), 1u) << "an acknowledged picture is on the disk";
  }
  StartGatewayProcess();
  KeptLease lease(control_.get(), "client", true);
  for (const double side_m : {0.02, 0.0}) {
    const Picture picture = Capture(lease.token(), side_m);
    ASSERT_TRUE(picture.status.ok()) << picture.status.error_message();
    taken.push_back(picture.response);
  }
  const auto stored = Export();
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->csv, "") << "there was no touch";
  ASSERT_TRUE(stored->images.has_value());
  const auto set = session::ParseImageSet(*stored->images);
  ASSERT_TRUE(set.ok()) << set.status();
  ASSERT_EQ(set->size(), 3u);
  EXPECT_EQ(set->camera.width_px, kWidth);
  EXPECT_EQ(set->camera.cx_px, 0.5 * kWidth);
  const double sides_m[] = {0.0, 0.02, 0.0};
  const int rounds[] = {0, 0, 1};
  for (int k = 0; k < 3; ++k) {
    const session::PhotographRow& row = set->photographs[k];
    EXPECT_EQ(row.commanded.eye_m, Eigen::Vector3d(sides_m[k], 0, 0.25));
    EXPECT_EQ(row.round, rounds[k]);
    if (k > 0) {
      EXPECT_GT(row.session_time_s, set->photographs[k - 1].session_time_s);
    }
    ASSERT_TRUE(row.measured.has_value());
    // What the client was told of the same picture.
    const v1::Vector3& told = taken[k].photographs(0).measured().eye_m();
    EXPECT_LT((row.measured->eye_m - Eigen::Vector3d(told.x(), told.y(), told.z())).norm(), 1e-9);
  }
  EXPECT_EQ(static_cast<size_t>(session::CountEmulated(*set)), set->size());
  // Imported at a server the session has the hash that the gateway tells.
  const v1::Session described = Describe();
  EXPECT_EQ(described.images(), 3u);
  EXPECT_EQ(described.hash(), set->sha256);
}

// Which way round a controller turns the tool on a line of half a turn depends on rounding. Driven the other way than was
// checked, the arm wound its wrist up to where no path led on, or stopped protectively out of its reach.
TEST_F(GatewayPhotographs, StandWhicheverWayRoundAControllerTurnsTheToolByHalfATurn) {
  StartEmulator();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  const auto from = [](double azimuth_deg, double polar_deg, double x_m) {
    const double azimuth_rad = azimuth_deg * kRadiansPerDegree, polar_rad = polar_deg * kRadiansPerDegree;
    v1::CameraPose camera;
    camera.mutable_eye_m()->set_x(x_m + 0.25 * std::sin(polar_rad) * std::cos(azimuth_rad));
    camera.mutable_eye_m()->set_y(0.25 * std::sin(polar_rad) * std::sin(azimuth_rad));
    camera.mutable_eye_m()->set_z(0.25 * std::cos(polar_rad));
    camera.mutable_at_m()->set_x(x_m);
    camera.mutable_up()->set_z(1);
    return camera;
  };
  for (const double longer : {0.0, 1.0}) {
    ASSERT_EQ(emulator_->faults().Set("half_turn_longer", longer), "");
    for (const double azimuth_deg : {0.0, 180.0, 15.0, 195.0, 30.0, 210.0}) {
      const Picture picture = Capture(lease.token(), from(azimuth_deg, 30, 0));
      EXPECT_TRUE(picture.status.ok())
          << "at " << azimuth_deg << " deg, longer way " << longer << ": " << picture.status.error_message();
    }
    // At the end of its reach: what cannot be driven is refused beforehand.
    for (const double azimuth_deg : {135.0, 315.0}) {
      const Picture picture = Capture(lease.token(), from(azimuth_deg, 38, -0.03));
      EXPECT_TRUE(picture.status.ok() || picture.status.error_code() == grpc::StatusCode::OUT_OF_RANGE)
          << "at " << azimuth_deg << " deg, longer way " << longer << ": " << picture.status.error_message();
    }
  }
  EXPECT_EQ(emulator_->controller().Count("protective_stops"), 0u);
}

// A rig that turns the object goes home before: a dry run from the picture before found ways that are not gone.
TEST_F(GatewayPhotographs, OfAnotherFaceAreCheckedFromHome) {
  StartEmulator();
  StartGateway();
  const auto way_to_the_second = [&](double first_x_m) {
    v1::CheckViewsRequest request;
    request.set_object("lat00");
    request.set_path(true);
    v1::CameraPose* first = request.add_views()->mutable_camera();
    first->mutable_eye_m()->set_x(first_x_m);
    first->mutable_eye_m()->set_z(0.25);
    first->mutable_up()->set_y(1);
    v1::CameraPose* second = request.add_views()->mutable_camera();
    second->mutable_eye_m()->set_x(0.25);
    second->mutable_up()->set_z(1);
    v1::CheckTouchesResponse response;
    grpc::ClientContext context;
    const grpc::Status status = rig_->CheckViews(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(response.checks_size(), 2);
    EXPECT_TRUE(response.checks(1).possible()) << response.checks(1).reason();
    return response.checks(1).ShortDebugString();
  };
  EXPECT_EQ(way_to_the_second(0), way_to_the_second(0.06));
}

TEST_F(GatewayPhotographs, AreNotTakenOnAFullDiskAndStandBesideTheTouchesOfTheirSession) {
  StartEmulator();
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  ASSERT_TRUE(Capture(lease.token(), 0).status.ok());
  const uint64_t programs = emulator_->controller().Count("programs");
  {
    const FullDisk full;
    const Picture refused = Capture(lease.token(), 0.02);
    EXPECT_EQ(refused.status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED)
        << refused.status.error_message();
    EXPECT_THAT(refused.status.error_message(), HasSubstr("make room"));
  }
  EXPECT_EQ(emulator_->controller().Count("programs"), programs) << "nothing moves that cannot be kept";
  EXPECT_EQ(Kept(), 1u);
  const Picture after = Capture(lease.token(), 0.02);
  ASSERT_TRUE(after.status.ok()) << after.status.error_message();

  // A touch of the same session: one export, for a joint diagnosis, on one clock.
  v1::TouchRequest request;
  request.set_object("lat00");
  *request.add_touches() = FromAbove();
  request.set_lease_token(lease.token());
  v1::TouchResponse response;
  grpc::ClientContext context;
  const grpc::Status touched = source_->Touch(&context, request, &response);
  ASSERT_TRUE(touched.ok()) << touched.error_message();
  auto stored = Export();
  ASSERT_TRUE(stored.ok()) << stored.status();
  ASSERT_TRUE(stored->images.has_value());
  EXPECT_EQ(stored->images->files_size(), 2);
  EXPECT_THAT(stored->csv, HasSubstr("t_l_us"));
  const auto described = service::DescribeSession("default", service::PackSession(*stored), "default");
  ASSERT_TRUE(described.ok()) << described.status();
  EXPECT_EQ(described->touches(), 1u);

  // To the trash and back, all of it.
  v1::DeleteSessionRequest deletion;
  deletion.set_name(kSession);
  deletion.set_lease_token(lease.token());
  v1::DeleteSessionResponse deleted;
  grpc::ClientContext delete_context;
  const auto sessions = v1::Sessions::NewStub(channel_);
  ASSERT_TRUE(sessions->DeleteSession(&delete_context, deletion, &deleted).ok());
  EXPECT_FALSE(Export().ok());
  v1::RestoreSessionRequest restoration;
  restoration.set_name(kSession);
  restoration.set_lease_token(lease.token());
  v1::Session restored;
  grpc::ClientContext restore_context;
  ASSERT_TRUE(sessions->RestoreSession(&restore_context, restoration, &restored).ok());
  EXPECT_EQ(restored.images(), 2u);
  const auto again = Export();
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(service::PackSession(*again), service::PackSession(*stored));
}

}  // namespace
}  // namespace touchstone
