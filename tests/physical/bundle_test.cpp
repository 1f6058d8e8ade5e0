// A bug report of an emulated rig, served again: it answers as the rig did, failures and refusals in their order, and has no
// way to a device. The emulated rig's data stand for no measurement.
#include <gmock/gmock.h>

#include <dirent.h>
#include <filesystem>
#include <fstream>

#include "server/base/text/text.h"
#include "server/gateway/bundle/make_bundle.h"
#include "server/gateway/bundle/replay.h"
#include "tests/physical/safety_fixture.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// What this process has open: sockets, ports, files.
std::vector<std::string> OpenFiles() {
  std::vector<std::string> open;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code ignored;
    open.push_back(std::filesystem::read_symlink(entry.path(), ignored).string());
  }
  return open;
}

class Bundle : public Safety {
 protected:
  // Of session "test", whose gateway has ended.
  std::string Make(const std::string& audit_log) {
    gateway::bundle::BundleRequest request;
    request.session = "test";
    request.config = emulator_->config_path();
    request.audit_log = audit_log;
    EXPECT_TRUE(gateway::bundle::TakeFilesOfConfig(&request).ok());
    const std::string path = folder_.Path("bug.tar.gz");
    const auto made = gateway::bundle::MakeBundle(request, path);
    EXPECT_TRUE(made.ok()) << made.status();
    return path;
  }

  void Replay(const std::string& path) {
    service::GatewayOptions options;
    options.replay = path;
    options.common.listen = "127.0.0.1:0";
    options.common.supershape_triangles = 2000;
    options.common.clock = &lease_clock_;
    // Of a rig that is there: a replay asks for none of it.
    options.arm.address = "127.0.0.1";
    options.effector.port = emulator_ == nullptr ? "/dev/ttyACM0" : emulator_->port_path();
    auto gateway = service::GatewayServer::Start(options);
    ASSERT_TRUE(gateway.ok()) << gateway.status();
    gateway_ = *std::move(gateway);
    channel_ = grpc::CreateChannel("127.0.0.1:" + std::to_string(gateway_->port()),
                                   grpc::InsecureChannelCredentials());
    source_ = v1::Source::NewStub(channel_);
    control_ = v1::Control::NewStub(channel_);
    rig_ = v1::Rig::NewStub(channel_);
  }

  std::string Exported(const std::string& session) {
    v1::ExportSessionRequest request;
    request.set_name(session);
    grpc::ClientContext context;
    const auto reader = v1::Sessions::NewStub(channel_)->ExportSession(&context, request);
    std::string csv;
    for (v1::ExportSessionResponse part; reader->Read(&part);) csv += part.csv();
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return csv;
  }

  static std::string TextOf(const Answer& answer) {
    return answer.status.ok()
               ? "done"
               : std::to_string(answer.status.error_code()) + ": " + answer.status.error_message();
  }
};

TEST_F(Bundle, AnswersAsTheRigDidWithItsFailuresAndRefusalsInOrder) {
  StartRig();
  StartGateway();
  std::vector<std::string> answers;
  std::string exported;
  v1::RigState before;
  v1::CommandedTouch too_fast = FromAbove(5);
  {
    KeptLease lease(control_.get(), "ana@bench2 rig-run 7", true);
    answers.push_back(TextOf(Touch(lease.token(), FromAbove(), "test/lat00/1")));
    // One fails in mid-approach, at a stop whose reason names somebody; the next is refused, and then both are made.
    auto interrupted = TouchLater(lease.token(), FromAbove(kSlow, 1), "test/lat00/2");
    WaitUntilApproaching();
    v1::StopRequest stop;
    stop.set_reason("Bo's cable");
    stop.set_holder("ana@bench2 rig-stop 8");
    v1::StopResponse stopped;
    grpc::ClientContext context;
    ASSERT_TRUE(control_->Stop(&context, stop, &stopped).ok());
    answers.push_back(TextOf(interrupted.get()));
    answers.push_back(TextOf(Touch(lease.token(), FromAbove(0.02, 2), "test/lat00/3")));
  }
  ASSERT_TRUE(Reset().ok());
  {
    KeptLease lease(control_.get(), "ana@bench2 rig-run 7", true);
    answers.push_back(TextOf(Touch(lease.token(), FromAbove(kSlow, 1), "test/lat00/2")));
    answers.push_back(TextOf(Touch(lease.token(), FromAbove(0.02, 2), "test/lat00/3")));
    // Never possible: it stands in no journal.
    answers.push_back(TextOf(Touch(lease.token(), too_fast, "test/lat00/4")));
  }
  ASSERT_THAT(answers, ElementsAre("done", HasSubstr("Bo's cable"), HasSubstr("Bo's cable"), "done", "done",
                                   HasSubstr("speed")));
  exported = Exported("test");
  before = RigState();
  StopGateway();
  const std::string bundle = Make("");
  emulator_ = nullptr;  // nobody is there any more

  Replay(bundle);
  std::vector<std::string> replayed;
  for (const auto& [touch, id] :
       {std::pair(FromAbove(), "1"), std::pair(FromAbove(kSlow, 1), "2"), std::pair(FromAbove(0.02, 2), "3"),
        std::pair(FromAbove(kSlow, 1), "2"), std::pair(FromAbove(0.02, 2), "3"), std::pair(too_fast, "4")})
    replayed.push_back(TextOf(Touch("", touch, std::string("session-1/lat00/") + id)));
  ASSERT_EQ(replayed.size(), answers.size());
  for (size_t k = 0; k < answers.size(); ++k) {
    // The same but for names.
    EXPECT_EQ(replayed[k].substr(0, 4), answers[k].substr(0, 4)) << replayed[k] << "\nnot\n" << answers[k];
    for (const char* name : {"ana", "bench2", "Bo", "cable"}) EXPECT_THAT(replayed[k], Not(HasSubstr(name)));
  }
  EXPECT_THAT(replayed[1], testing::ContainsRegex("person-[0-9]+@host-[0-9]+ rig-stop 8"));
  EXPECT_EQ(Exported("session-1"), exported) << "a touch that was tried again left a gap in the numbers";
  EXPECT_EQ(RigState().calibration(), before.calibration());
}

TEST_F(Bundle, SaysEverywhereThatItIsAReplay) {
  StartRig();
  StartGateway();
  {
    KeptLease lease(control_.get(), "ana@bench2", true);
    ASSERT_TRUE(Touch(lease.token(), FromAbove(), "a").status.ok());
  }
  StopGateway();
  Replay(Make(""));
  const v1::RigState state = RigState();
  EXPECT_THAT(state.provenance(), testing::StartsWith("replay of bug.tar.gz; "));
  EXPECT_TRUE(state.emulated()) << "what is written down anew is marked";
  EXPECT_THAT(state.safety_notice(), HasSubstr("REPLAY of bug.tar.gz: no hardware is opened"));
  EXPECT_FALSE(state.arm().connected());
}

TEST_F(Bundle, NeverOpensADeviceNorMovesAnArm) {
  StartRig();
  StartGateway();
  {
    KeptLease lease(control_.get(), "ana@bench2", true);
    ASSERT_TRUE(Touch(lease.token(), FromAbove(), "a").status.ok());
  }
  StopGateway();
  const std::string bundle = Make("");
  const size_t commands = emulator_->controller().Commands().size();
  const std::vector<std::string> before = OpenFiles();
  Replay(bundle);  // with the address and the port of the rig, which runs
  KeptLease lease(control_.get(), "ana@bench2", true);
  const auto refused = [&](const grpc::Status& status) {
    EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION);
    EXPECT_THAT(status.error_message(), HasSubstr("there is no arm behind it, and nothing moves"));
  };
  refused(PowerOn(lease.token()));
  v1::HomeRequest home;
  home.set_lease_token(lease.token());
  v1::RigState state;
  grpc::ClientContext homing, mounting;
  refused(rig_->Home(&homing, home, &state));
  v1::MountObjectRequest mount;
  mount.set_object("lat10");
  mount.set_lease_token(lease.token());
  EXPECT_TRUE(rig_->MountObject(&mounting, mount, &state).ok());
  EXPECT_EQ(state.object(), "lat10") << "in its memory";
  EXPECT_TRUE(Touch("", FromAbove(), "a").status.ok());
  EXPECT_EQ(Touch("", FromAbove(0.02, 3), "new").status.error_code(), grpc::NOT_FOUND);
  Stop("a test");
  ASSERT_TRUE(Reset().ok());

  EXPECT_EQ(emulator_->controller().Commands().size(), commands) << "the controller was told something";
  EXPECT_FALSE(gateway_->device().moves());
  const std::string port = std::filesystem::canonical(emulator_->port_path());
  EXPECT_EQ(std::count(before.begin(), before.end(), port), [&] {
    const std::vector<std::string> now = OpenFiles();
    return std::count(now.begin(), now.end(), port);
  }()) << "the serial port was opened";
}

TEST_F(Bundle, WithoutAnAuditLogAFailedTouchHasItsLastError) {
  StartRig();
  StartGateway();
  {
    KeptLease lease(control_.get(), "ana@bench2", true);
    auto interrupted = TouchLater(lease.token(), FromAbove(kSlow), "a");
    WaitUntilApproaching();
    Stop("a test");
    EXPECT_FALSE(interrupted.get().status.ok());
  }
  StopGateway();
  std::filesystem::remove(folder_.Path("rig/audit.jsonl"));
  Replay(Make(""));
  for (int k = 0; k < 2; ++k) {
    const Answer answer = Touch("", FromAbove(kSlow), "a");
    EXPECT_EQ(answer.status.error_code(), grpc::UNKNOWN);
    EXPECT_THAT(answer.status.error_message(), HasSubstr("stopped"));
  }
}

TEST_F(Bundle, OfSomebodyWhoMeansHarmIsRefusedByName) {
  std::ofstream(folder_.Path("bug.tar.gz"), std::ios::binary) << "\x1f\x8b" << std::string(100, 'x');
  service::GatewayOptions options;
  options.replay = folder_.Path("bug.tar.gz");
  options.common.listen = "127.0.0.1:0";
  const auto gateway = service::GatewayServer::Start(options);
  ASSERT_FALSE(gateway.ok());
  EXPECT_THAT(std::string(gateway.status().message()), HasSubstr("bug.tar.gz: is no gzipped tar"));
}

}  // namespace
}  // namespace touchstone
