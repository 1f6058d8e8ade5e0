// A real server with real certificates: who gets in, who does not and what they are told, and what changes while it runs.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <mutex>
#include <thread>

#include "server/base/files/file_writer.h"
#include "server/base/threads/manual_clock.h"
#include "server/service/core/access.h"
#include "server/service/rpc/server.h"
#include "server/service/tests/test_call.h"
#include "server/service/tests/test_certificates.h"
#include "touchstone/v1/control.grpc.pb.h"
#include "touchstone/v1/diagnosis.grpc.pb.h"

namespace touchstone::service {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class TextSink : public spdlog::sinks::base_sink<std::mutex> {
 public:
  std::string text() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return text_;
  }

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    text_.append(message.payload.data(), message.payload.size()).append("\n");
  }
  void flush_() override {}

  std::string text_;
};

// The log of this process while it lives.
class CapturedLog {
 public:
  CapturedLog() : before_(spdlog::default_logger()) {
    auto logger = std::make_shared<spdlog::logger>("test", sink_);
    logger->set_level(spdlog::level::trace);
    spdlog::set_default_logger(logger);
  }
  ~CapturedLog() { spdlog::set_default_logger(before_); }
  std::string text() const { return sink_->text(); }

 private:
  std::shared_ptr<TextSink> sink_ = std::make_shared<TextSink>();
  std::shared_ptr<spdlog::logger> before_;
};

// Whether a call of it goes on as long as the client likes.
bool Endless(const std::string& method) {
  return method == "/grpc.health.v1.Health/Watch";
}

constexpr char kDescribe[] = "/touchstone.v1.Source/Describe";

class AccessServerTest : public testing::Test {
 protected:
  AccessServerTest() {
    certificates_.Issue("server", "DNS:localhost,IP:127.0.0.1");
    for (const Role role : {Role::kReader, Role::kOperator, Role::kAdmin}) tokens_[role] = NewAccessToken();
    WriteTokens();
    options_.listen = "0.0.0.0:0";
    options_.supershape_triangles = 500;
    options_.threads = 1;
    options_.access.tls_cert = certificates_.Path("server.pem");
    options_.access.tls_key = certificates_.Path("server.key");
    options_.access.token_file = certificates_.Path("tokens");
  }

  void WriteTokens() {
    std::string text;
    for (const auto& [role, token] : tokens_)
      text += std::string(RoleName(role)) + "-of-tests " + RoleName(role) + " " + HashOfToken(token) + "\n";
    WriteTokenFile(text);
  }
  void WriteTokenFile(const std::string& text) {
    ASSERT_TRUE(WriteFileAtomically(certificates_.Path("tokens"), text).ok());
  }
  void Start() {
    auto server = Server::Start(options_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  // A connection of its own, with a certificate of a client if one is named.
  std::shared_ptr<grpc::Channel> Channel(const std::string& client = "", const std::string& ca = "ca") {
    grpc::SslCredentialsOptions tls;
    tls.pem_root_certs = certificates_.Text(ca + ".pem");
    if (!client.empty()) {
      tls.pem_cert_chain = certificates_.Text(client + ".pem");
      tls.pem_private_key = certificates_.Text(client + ".key");
    }
    return Channel(grpc::SslCredentials(tls));
  }
  std::shared_ptr<grpc::Channel> Channel(const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel("localhost:" + std::to_string(server_->port()), credentials, arguments);
  }
  // Of the certificate that a new connection is shown.
  bool Trusts(const std::string& ca) {
    return CallAny(Channel("", ca), kDescribe, tokens_[Role::kReader]).ok();
  }

  TestCertificates certificates_;
  std::map<Role, std::string> tokens_;
  ServerOptions options_;
  std::unique_ptr<Server> server_;
};

TEST_F(AccessServerTest, EveryMethodTakesItsRoleAndRefusesEachLowerOne) {
  Start();
  const auto channel = Channel();
  for (const MethodRole& row : MethodRoles()) {
    if (Endless(row.method)) continue;
    const grpc::Status stranger = CallAny(channel, row.method, "");
    EXPECT_EQ(stranger.error_code() == grpc::UNAUTHENTICATED, row.simulated != Role::kNobody) << row.method;
    for (const auto& [role, token] : tokens_) {
      const grpc::Status status = CallAny(channel, row.method, token);
      EXPECT_NE(status.error_code(), grpc::UNAUTHENTICATED) << row.method;
      EXPECT_EQ(status.error_code() == grpc::PERMISSION_DENIED, role < row.simulated)
          << row.method << status.error_message();
      if (role < row.simulated) {
        EXPECT_THAT(status.error_message(),
                    AllOf(HasSubstr(MethodName(row.method) + " needs the role " + RoleName(row.simulated)),
                          HasSubstr(std::string("has the role ") + RoleName(role))));
      }
    }
  }
}

TEST_F(AccessServerTest, ADiagnosisThatKeepsItsModelTakesAnAdmin) {
  Start();
  const auto stub = v1::Diagnosis::NewStub(Channel());
  const auto diagnose = [&](Role role) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + tokens_[role]);
    v1::DiagnoseRequest request;
    request.set_save_model("mine");
    v1::DiagnoseResponse response;
    const auto reader = stub->Diagnose(&context, request);
    while (reader->Read(&response)) {
    }
    return reader->Finish();
  };
  EXPECT_EQ(diagnose(Role::kOperator).error_code(), grpc::PERMISSION_DENIED);
  EXPECT_THAT(diagnose(Role::kReader).error_message(),
              HasSubstr("with save_model needs the role admin; 'reader-of-tests'"));
  EXPECT_EQ(diagnose(Role::kAdmin).error_code(), grpc::INVALID_ARGUMENT);  // without evidence
}

TEST_F(AccessServerTest, TellsStrangersWhatIsMissing) {
  Start();
  EXPECT_THAT(CallAny(Channel(), kDescribe, "").error_message(),
              AllOf(HasSubstr("--token-file"), Not(HasSubstr("--tls-cert"))));
  const grpc::Status unknown = CallAny(Channel(), kDescribe, NewAccessToken());
  EXPECT_EQ(unknown.error_code(), grpc::UNAUTHENTICATED);
  EXPECT_THAT(unknown.error_message(), HasSubstr("not known here"));
  // What is not there is not told apart for those who may not look.
  EXPECT_EQ(CallAny(Channel(), "/touchstone.v1.Nothing/Here", "").error_code(), grpc::UNAUTHENTICATED);
  EXPECT_EQ(CallAny(Channel(), "/touchstone.v1.Nothing/Here", tokens_[Role::kReader]).error_code(),
            grpc::UNIMPLEMENTED);
  EXPECT_EQ(
      CallAny(Channel(grpc::InsecureChannelCredentials()), kDescribe, tokens_[Role::kAdmin]).error_code(),
      grpc::UNAVAILABLE);
}

TEST_F(AccessServerTest, TakesCertificatesOfItsClientCaAndNoOthers) {
  certificates_.MakeCa("stranger");
  certificates_.Issue("node7", "DNS:node7.lab");
  certificates_.Issue("node8", "DNS:node8.lab");
  certificates_.Issue("evil", "DNS:node7.lab", "stranger");
  options_.access.tls_client_ca = certificates_.Path("ca.pem");
  WriteTokenFile("seven operator cert:node7.lab\nana reader " + HashOfToken(tokens_[Role::kReader]) + "\n");
  Start();
  constexpr char kAcquire[] = "/touchstone.v1.Control/AcquireLease",
                 kCreate[] = "/touchstone.v1.Models/CreateModel";
  EXPECT_EQ(CallAny(Channel("node7"), kAcquire, "").error_code(),
            grpc::INVALID_ARGUMENT);  // let in, and then looked at
  EXPECT_THAT(CallAny(Channel("node7"), kCreate, "").error_message(),
              HasSubstr("'seven' has the role operator"));
  EXPECT_TRUE(CallAny(Channel("node8"), kDescribe, "").ok());
  EXPECT_THAT(CallAny(Channel("node8"), kAcquire, "").error_message(),
              HasSubstr("'node8' has the role reader"));
  EXPECT_EQ(CallAny(Channel("evil"), kDescribe, "").error_code(), grpc::UNAVAILABLE);
  EXPECT_EQ(CallAny(Channel(), kDescribe, "").error_code(), grpc::UNAUTHENTICATED);
  EXPECT_TRUE(CallAny(Channel(), kDescribe, tokens_[Role::kReader]).ok());
  // A token that is shown counts, whatever the certificate.
  EXPECT_EQ(CallAny(Channel("node7"), kDescribe, "wrong").error_code(), grpc::UNAUTHENTICATED);
}

TEST_F(AccessServerTest, TokensChangeWhileItRuns) {
  Start();
  const auto channel = Channel();
  const std::string former = tokens_[Role::kReader];
  ASSERT_TRUE(CallAny(channel, kDescribe, former).ok());
  tokens_[Role::kReader] = NewAccessToken();
  WriteTokens();
  EXPECT_EQ(CallAny(channel, kDescribe, former).error_code(), grpc::UNAUTHENTICATED);
  EXPECT_TRUE(CallAny(channel, kDescribe, tokens_[Role::kReader]).ok());
  // A file that cannot be meant locks nobody out, and lets nobody in.
  WriteTokenFile("half a li");
  EXPECT_TRUE(CallAny(channel, kDescribe, tokens_[Role::kReader]).ok());
  EXPECT_EQ(CallAny(channel, kDescribe, former).error_code(), grpc::UNAUTHENTICATED);
  std::filesystem::remove(certificates_.Path("tokens"));
  EXPECT_TRUE(CallAny(channel, kDescribe, tokens_[Role::kReader]).ok());
}

TEST_F(AccessServerTest, CertificatesChangeWhileItRuns) {
  Start();
  EXPECT_TRUE(Trusts("ca"));
  const auto kept = Channel();
  ASSERT_TRUE(CallAny(kept, kDescribe, tokens_[Role::kReader]).ok());
  certificates_.MakeCa("next");
  certificates_.Issue("renewed", "DNS:localhost", "next");
  EXPECT_FALSE(Trusts("next"));
  // Between the two files the former certificate serves on.
  std::filesystem::rename(certificates_.Path("renewed.pem"), certificates_.Path("server.pem"));
  EXPECT_TRUE(Trusts("ca"));
  std::filesystem::rename(certificates_.Path("renewed.key"), certificates_.Path("server.key"));
  EXPECT_TRUE(Trusts("next"));
  EXPECT_FALSE(Trusts("ca"));
  EXPECT_TRUE(CallAny(kept, kDescribe, tokens_[Role::kReader]).ok()) << "a connection that stands was cut";
}

TEST_F(AccessServerTest, DoesNotStartOpenToOthersOrWithFilesThatAreNoneOfItsKind) {
  const auto refused = [&](const AccessOptions& access) {
    ServerOptions options = options_;
    options.access = access;
    return std::string(Server::Start(options).status().message());
  };
  EXPECT_THAT(refused({}), AllOf(HasSubstr("listen = '0.0.0.0:0'"), HasSubstr("--insecure")));
  AccessOptions access = options_.access;
  access.tls_key = certificates_.Path("ca.key");
  EXPECT_THAT(refused(access), AllOf(HasSubstr("ca.key"), HasSubstr("is not the private key of")));
  access.tls_key = certificates_.Path("server.pem");
  EXPECT_THAT(refused(access), HasSubstr("holds no private key"));
  access = options_.access;
  access.tls_cert = certificates_.Path("absent.pem");
  EXPECT_THAT(refused(access), AllOf(HasSubstr("tls_cert"), HasSubstr("absent.pem")));
  access = options_.access;
  access.tls_client_ca = certificates_.Path("tokens");
  EXPECT_THAT(refused(access), HasSubstr("holds no certificate"));
  WriteTokenFile("# nobody yet\n");
  EXPECT_THAT(refused(options_.access), AllOf(HasSubstr("token_file"), HasSubstr("touchstone token new")));
}

TEST_F(AccessServerTest, InsecureIsSaidAgainAndAgain) {
  CapturedLog log;
  options_.access = {};
  options_.access.insecure = true;
  ManualClock clock;
  options_.clock = &clock;
  Start();
  EXPECT_TRUE(CallAny(Channel(grpc::InsecureChannelCredentials()), kDescribe, "").ok());
  const std::string words = "insecure: 0.0.0.0:0 is served in plain text, to whoever reaches it";
  const auto times = [&] {
    int count = 0;
    const std::string text = log.text();
    for (size_t at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++count;
    return count;
  };
  for (int said = 1; said <= 3; ++said) {
    clock.AwaitWaiters();
    EXPECT_EQ(times(), said);
    EXPECT_EQ(clock.AdvanceToFirst(), 60) << "once a minute";
  }
  server_.reset();  // its threads use the log
}

TEST_F(AccessServerTest, NoTokenStandsInTheLogAndWhoStopsDoes) {
  CapturedLog log;
  const std::string wrong = NewAccessToken();
  Start();
  const auto channel = Channel();
  for (const MethodRole& row : MethodRoles())
    if (!Endless(row.method))
      for (const std::string& token : {wrong, tokens_[Role::kReader], tokens_[Role::kAdmin]})
        CallAny(channel, row.method, token);
  v1::StopRequest stop;
  stop.set_holder("ana@bench2");
  v1::StopResponse stopped;
  grpc::ClientContext context;
  context.AddMetadata("authorization", "Bearer " + tokens_[Role::kReader]);
  EXPECT_TRUE(v1::Control::NewStub(channel)->Stop(&context, stop, &stopped).ok());
  tokens_[Role::kOperator] = NewAccessToken();
  WriteTokens();
  CallAny(channel, kDescribe, wrong);
  server_.reset();
  const std::string text = log.text();
  EXPECT_THAT(text, AllOf(HasSubstr("refused Source.Describe"), HasSubstr("has changed")));
  EXPECT_THAT(text, HasSubstr("stop from ana@bench2 (reader-of-tests, reader)"));
  EXPECT_THAT(text, Not(HasSubstr(wrong)));
  for (const auto& [role, token] : tokens_)
    EXPECT_THAT(text, AllOf(Not(HasSubstr(token)), Not(HasSubstr("sha256"))));
}

TEST_F(AccessServerTest, ALeaseNamesWhoWasFoundToHoldIt) {
  Start();
  const auto stub = v1::Control::NewStub(Channel());
  v1::AcquireLeaseRequest request;
  v1::Lease lease;
  request.set_holder("ana@bench2");
  for (int round = 0; round < 2; ++round) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + tokens_[Role::kOperator]);
    request.set_take(true);
    ASSERT_TRUE(stub->AcquireLease(&context, request, &lease).ok());
    EXPECT_EQ(lease.holder(), "ana@bench2 (operator-of-tests, operator)");
    request.set_holder(lease.holder());  // as who acquires it again may say
  }
}

TEST_F(AccessServerTest, OnThisMachineATokenIsAskedForInPlainTextToo) {
  options_.listen = "127.0.0.1:0";
  options_.access.tls_cert.clear();
  options_.access.tls_key.clear();
  Start();
  const auto channel = Channel(grpc::InsecureChannelCredentials());
  EXPECT_EQ(CallAny(channel, kDescribe, "").error_code(), grpc::UNAUTHENTICATED);
  EXPECT_TRUE(CallAny(channel, kDescribe, tokens_[Role::kReader]).ok());
  // Inside of the process nobody is asked.
  EXPECT_TRUE(CallAny(server_->InProcessChannel(), kDescribe, "").ok());
}

}  // namespace
}  // namespace touchstone::service
