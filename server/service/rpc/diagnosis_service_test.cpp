// Sessions and Diagnosis over a channel: what is checked before any work, progress, cancellation, limits.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <thread>

#include "server/service/calls/evidence.h"
#include "server/service/rpc/server.h"
#include "touchstone/v1/diagnosis.grpc.pb.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone::service {
namespace {

using ::testing::HasSubstr;

class DiagnosisServiceTest : public ::testing::Test {
 protected:
  void Start(ServerOptions options = {}) {
    options.listen = "";
    options.supershape_triangles = 2000;
    options.threads = 2;
    auto server = Server::Start(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    diagnosis_ = v1::Diagnosis::NewStub(server_->InProcessChannel());
    sessions_ = v1::Sessions::NewStub(server_->InProcessChannel());
  }

  // Touches from all round, whose times are noise: enough for the services, which do not look at them.
  static std::string Csv(int touches, const std::string& object = "lat00") {
    std::string csv =
        "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,"
        "approach_z,"
        "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n";
    for (int k = 0; k < touches; ++k)
      absl::StrAppend(&csv, k, ",", object, ",20,100,", k % 17, ",", k % 13, ",", k % 5, ",0,0,-1,1,0,0,",
                      k * 7919 % 10007, ",", k * 104729 % 10007, ",0\n");
    return csv;
  }

  grpc::Status Compare(const v1::Evidence& evidence, int* messages = nullptr, v1::Report* report = nullptr) {
    grpc::ClientContext context;
    v1::CompareRequest request;
    *request.mutable_evidence() = evidence;
    const auto reader = diagnosis_->Compare(&context, request);
    v1::CompareResponse response;
    while (reader->Read(&response)) {
      if (messages != nullptr) ++*messages;
      if (response.has_report() && report != nullptr) *report = response.report();
    }
    return reader->Finish();
  }

  std::unique_ptr<Server> server_;
  std::unique_ptr<v1::Diagnosis::Stub> diagnosis_;
  std::unique_ptr<v1::Sessions::Stub> sessions_;
};

TEST_F(DiagnosisServiceTest, ASessionGivesTheReportOfItsBytes) {
  Start();
  grpc::ClientContext context;
  v1::Session session;
  const auto writer = sessions_->CreateSession(&context, &session);
  const std::string csv = Csv(40);
  v1::CreateSessionRequest piece;
  piece.set_name("monday");
  for (size_t begin = 0; begin < csv.size(); begin += 100) {
    piece.set_csv(csv.substr(begin, 100));
    ASSERT_TRUE(writer->Write(piece));
    piece.clear_name();
  }
  writer->WritesDone();
  ASSERT_TRUE(writer->Finish().ok());
  EXPECT_EQ(session.touches(), 40u);

  v1::Report of_session, of_bytes;
  v1::Evidence evidence;
  evidence.set_session("monday");
  evidence.set_origin("set.csv");
  ASSERT_TRUE(Compare(evidence, nullptr, &of_session).ok());
  evidence.set_csv(csv);
  ASSERT_TRUE(Compare(evidence, nullptr, &of_bytes).ok());
  EXPECT_EQ(of_session.version(), kVersion);
  of_session.clear_duration_s();
  of_bytes.clear_duration_s();
  EXPECT_EQ(of_session.SerializeAsString(), of_bytes.SerializeAsString());
}

TEST_F(DiagnosisServiceTest, EvidenceIsCheckedBeforeAnyWork) {
  Start();
  const auto message = [&](const v1::Evidence& evidence) { return Compare(evidence).error_message(); };
  v1::Evidence evidence;
  EXPECT_THAT(message(evidence), HasSubstr("evidence.measurements is empty"));
  evidence.set_session("tuesday");
  EXPECT_THAT(message(evidence), HasSubstr("no session is named 'tuesday'"));
  evidence.set_csv(Csv(3, "cup"));
  EXPECT_THAT(message(evidence), HasSubstr("measurements:2: column object: 'cup' has no mesh"));
  evidence.set_origin("set.csv");
  v1::MeshFile* mesh = evidence.add_meshes();
  mesh->set_name("cup");
  mesh->set_format(v1::MeshFile::OFF);
  mesh->set_data("OFF\n3 1 0\n0 0 0\n1 0\n");
  EXPECT_THAT(message(evidence), HasSubstr("mesh 'cup': "));
  mesh->clear_format();
  EXPECT_THAT(message(evidence), HasSubstr("mesh 'cup': format is not set; one of off, obj, stl, ply"));
  *evidence.add_meshes() = *mesh;
  EXPECT_THAT(message(evidence), HasSubstr("two are named 'cup'"));
  evidence.clear_meshes();
  evidence.set_csv(Csv(3));
  evidence.mutable_model()->set_name("nomnal");
  EXPECT_THAT(message(evidence), HasSubstr("did you mean 'nominal'?"));
  evidence.clear_model();
  evidence.add_also_yaml(
      "touchstone: model/1\nname: empty\nend_effector: {fingers: 3, spacing_mm: 30}\neffects: []\n");
  EXPECT_THAT(message(evidence), HasSubstr("also_yaml[0]"));
  evidence.clear_also_yaml();
  evidence.set_csv("object,t_0_us\nlat00,inf\n");
  EXPECT_THAT(message(evidence), HasSubstr("set.csv:2: column t_0_us: 'inf'"));
}

TEST_F(DiagnosisServiceTest, AnObjectOfTheRequestComesBeforeTheServersOwn) {
  Start();
  v1::Evidence evidence;
  evidence.set_csv(Csv(3));
  v1::MeshFile* mesh = evidence.add_meshes();
  mesh->set_name("lat00");
  mesh->set_format(v1::MeshFile::OFF);
  mesh->set_data("not even a header");
  EXPECT_THAT(Compare(evidence).error_message(), HasSubstr("mesh 'lat00'"));
}

TEST_F(DiagnosisServiceTest, ShowsProgressAndCanBeCancelled) {
  Start();
  v1::DiagnoseRequest request;
  request.mutable_evidence()->set_csv(Csv(20'000));
  grpc::ClientContext context;
  const auto reader = diagnosis_->Diagnose(&context, request);
  v1::DiagnoseResponse response;
  ASSERT_TRUE(reader->Read(&response));
  // Said before the work begins.
  EXPECT_EQ(response.progress().stage(), "reading");
  context.TryCancel();
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  // The server lets go of it: its destruction waits for running calls.
  server_.reset();
}

TEST_F(DiagnosisServiceTest, WorksOnAFewSetsAtOnce) {
  ServerOptions options;
  options.max_diagnoses = 1;
  options.max_proposed_touches = 10;
  Start(options);
  v1::DiagnoseRequest request;
  request.mutable_evidence()->set_csv(Csv(20'000));
  grpc::ClientContext context;
  const auto reader = diagnosis_->Diagnose(&context, request);
  v1::DiagnoseResponse response;
  ASSERT_TRUE(reader->Read(&response));
  v1::Evidence evidence;
  evidence.set_csv(Csv(3));
  const grpc::Status status = Compare(evidence);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("max_diagnoses"));
  context.TryCancel();
  reader->Finish();

  v1::ProposeRequest too_many;
  too_many.set_touches(11);
  grpc::ClientContext other;
  v1::ProposeResponse proposed;
  const auto proposals = diagnosis_->Propose(&other, too_many);
  EXPECT_FALSE(proposals->Read(&proposed));
  EXPECT_THAT(proposals->Finish().error_message(), HasSubstr("touches = 11: at most 10"));
}

TEST(Evidence, AnEffectAloneBecomesAModelFile) {
  EXPECT_EQ(AsModelFile("touchstone: model/1\nname: a\n"), "touchstone: model/1\nname: a\n");
  EXPECT_THAT(AsModelFile("# mine\nformula:\n  name: x"),
              HasSubstr("effects:\n    # mine\n  - formula:\n      name: x\n"));
  EXPECT_THAT(AsModelFile("- tip_radius: {radius_mm: 1}"),
              HasSubstr("effects:\n  - tip_radius: {radius_mm: 1}\n"));
}

}  // namespace
}  // namespace touchstone::service
