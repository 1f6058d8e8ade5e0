// A gateway that serves a journal again: its lists in pages, and clients that do not read what they asked for.
#include <absl/cleanup/cleanup.h>
#include <absl/strings/match.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <memory>
#include <mutex>

#include "server/base/test_folder.h"
#include "server/base/threads/manual_clock.h"
#include "server/service/gateway/gateway_server.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/journal/journal.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone {
namespace {

using session::Journal;
using testing::ElementsAre;
using testing::HasSubstr;

// A touch of one finger that is done.
session::JournalTouch TouchOf(int number) {
  v1::CommandedTouch command;
  command.mutable_target_m()->set_x(1e-6 * number);
  command.mutable_approach()->set_z(-1);
  command.mutable_lateral()->set_x(1);
  command.set_standoff_m(0.05);
  command.set_speed_m_s(0.02);
  session::JournalTouch touch;
  touch.id = std::to_string(number);
  touch.object = "lat20";
  touch.command = session::CommandBytes(command);
  touch.stage = session::TouchStage::kDone;
  touch.result.fingers.resize(1);
  touch.result.fingers[0].contact_time_s = 1e-6 * number;
  return touch;
}

// Whether a call was cancelled since its client read nothing.
class StallSink : public spdlog::sinks::base_sink<std::mutex> {
 public:
  std::atomic<bool> seen{false};

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (absl::StrContains(absl::string_view(message.payload.data(), message.payload.size()), "stall_s"))
      seen = true;
  }
  void flush_() override {}
};

class RecordedSessions : public testing::Test {
 protected:
  void AddSession(const std::string& name, int touches) {
    const auto journal = Journal::Open(path_, Journal::Mode::kCreateOrReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    session::JournalSession session;
    session.name = name;
    session.fingers = 1;
    ASSERT_TRUE((*journal)->EnsureSession(session).ok());
    std::vector<session::JournalTouch> all;
    for (int k = 0; k < touches; ++k) all.push_back(TouchOf(k));
    ASSERT_TRUE((*journal)->AddFinished(name, all).ok());
  }

  void Delete(const std::string& name) {
    const auto journal = Journal::Open(path_, Journal::Mode::kReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    ASSERT_TRUE((*journal)->DeleteSession(name, "ana@lab").ok());
  }

  void Start() {
    service::GatewayOptions options;
    options.replay = path_;
    options.common.listen = "127.0.0.1:0";
    options.common.supershape_triangles = 2000;
    options.common.clock = &clock_;
    options.common.stall_s = kStallS;
    auto gateway = service::GatewayServer::Start(options);
    ASSERT_TRUE(gateway.ok()) << gateway.status();
    gateway_ = *std::move(gateway);
    // What a client that does not read holds back for it is small, so that the gateway notices soon.
    grpc::ChannelArguments small;
    small.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 64 << 10);
    small.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
    channel_ = grpc::CreateCustomChannel("127.0.0.1:" + std::to_string(gateway_->port()),
                                         grpc::InsecureChannelCredentials(), small);
  }

  grpc::Status List(const v1::ListSessionsRequest& request, v1::ListSessionsResponse* response) {
    grpc::ClientContext context;
    return v1::Sessions::NewStub(channel_)->ListSessions(&context, request, response);
  }

  // Names of a page of two; `token` is what asked for it, and then what asks for the next one.
  std::vector<std::string> Names(bool deleted, std::string* token) {
    v1::ListSessionsRequest request;
    request.set_deleted(deleted);
    request.set_page_size(2);
    request.set_page_token(*token);
    v1::ListSessionsResponse response;
    const grpc::Status status = List(request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    *token = response.next_page_token();
    std::vector<std::string> names;
    for (const v1::Session& session : response.sessions()) names.push_back(session.name());
    return names;
  }

  static constexpr double kStallS = 300;

  ManualClock clock_;
  const TestFolder folder_;
  const std::string path_ = folder_.Path("rig.db");
  std::unique_ptr<service::GatewayServer> gateway_;
  std::shared_ptr<grpc::Channel> channel_;
};

TEST_F(RecordedSessions, ComeInPagesInTheOrderInWhichTheyWereMade) {
  for (const char* name : {"c", "a", "b", "e", "d"}) AddSession(name, 1);
  Start();
  std::string token;
  EXPECT_THAT(Names(false, &token), ElementsAre("c", "a"));
  EXPECT_THAT(Names(false, &token), ElementsAre("b", "e"));
  EXPECT_THAT(Names(false, &token), ElementsAre("d"));
  EXPECT_EQ(token, "");
}

TEST_F(RecordedSessions, OfTheTrashComeTheLastDeletedFirst) {
  for (const char* name : {"a", "b", "c", "d"}) AddSession(name, 1);
  for (const char* name : {"b", "d", "a"}) Delete(name);
  AddSession("a", 1);  // the name is free again, and may be deleted twice
  Delete("a");
  Start();
  std::string token;
  EXPECT_THAT(Names(true, &token), ElementsAre("a", "a"));
  EXPECT_THAT(Names(true, &token), ElementsAre("d", "b"));
  EXPECT_EQ(token, "");
  EXPECT_THAT(Names(false, &token), ElementsAre("c"));
}

TEST_F(RecordedSessions, ATokenThatNoPageGaveIsRefused) {
  AddSession("a", 1);
  Start();
  for (const char* token : {"a", "1", "1 2 3", "x y", "1 9223372036854775808"}) {
    v1::ListSessionsRequest request;
    request.set_page_token(token);
    v1::ListSessionsResponse response;
    const grpc::Status status = List(request, &response);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << token;
    EXPECT_THAT(status.error_message(), HasSubstr("next_page_token of the page before")) << token;
  }
}

TEST_F(RecordedSessions, AnExportThatNobodyReadsIsCancelled) {
  AddSession("large", 30'000);
  const auto stalled = std::make_shared<StallSink>();
  spdlog::default_logger()->sinks().push_back(stalled);
  const absl::Cleanup restore = [this] {
    gateway_ = nullptr;  // its threads use the logger
    spdlog::default_logger()->sinks().pop_back();
  };
  Start();
  grpc::ClientContext context;
  v1::ExportSessionRequest request;
  request.set_name("large");
  const auto reader = v1::Sessions::NewStub(channel_)->ExportSession(&context, request);
  v1::ExportSessionResponse response;
  ASSERT_TRUE(reader->Read(&response));
  // It reads no more, and time passes until the gateway has had enough.
  const auto read = clock_.Now();
  while (!stalled->seen) clock_.Advance(1);
  EXPECT_GT(clock_.SecondsSince(read), kStallS);
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::CANCELLED);
}

}  // namespace
}  // namespace touchstone
