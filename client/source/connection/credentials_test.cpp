// What a client is told about a server whose credentials do not fit, and what it is let to do where they do.
#include "client/source/connection/credentials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "client/source/connection/connection.h"
#include "server/base/files/file_writer.h"
#include "server/service/core/access.h"
#include "server/service/tests/test_certificates.h"

namespace touchstone::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class CredentialsTest : public testing::Test {
 protected:
  CredentialsTest() {
    files_.Issue("server", "DNS:localhost");
    std::ofstream(files_.Path("token")) << token_ << "\n";
    WriteTokens(token_);
    server_.listen = "127.0.0.1:0";
    server_.supershape_triangles = 500;
    server_.threads = 1;
    server_.access.tls_cert = files_.Path("server.pem");
    server_.access.tls_key = files_.Path("server.key");
    server_.access.token_file = files_.Path("tokens");
  }

  void WriteTokens(const std::string& token) {
    ASSERT_TRUE(
        WriteFileAtomically(files_.Path("tokens"), "ana reader " + service::HashOfToken(token) + "\n").ok());
  }
  void Start() { running_ = service::Server::Start(server_).value(); }
  // Waits for a server that starts, which none of these does: whatever is wrong must be said at once.
  absl::StatusOr<std::unique_ptr<Connection>> Open(const Credentials& credentials,
                                                   const std::string& host = "localhost") {
    ConnectionOptions options;
    options.servers = {host + ":" + std::to_string(running_->port())};
    options.credentials = credentials;
    options.wait_s = 500;
    options.connect_timeout_s = 60;
    return Connection::Open(std::move(options));
  }
  std::string Refusal(const Credentials& credentials, const std::string& host = "localhost") {
    const absl::Status status = Open(credentials, host).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr(token_)));
    return std::string(status.message());
  }
  static absl::Status Describe(Connection* connection) {
    return connection->Call(&v1::Source::Stub::Describe, v1::DescribeRequest()).status();
  }

  service::TestCertificates files_;
  const std::string token_ = service::NewAccessToken();
  service::ServerOptions server_;
  std::unique_ptr<service::Server> running_;
};

TEST_F(CredentialsTest, ATokenIsShownAndReadAgain) {
  Start();
  Credentials shown;
  shown.tls_ca = files_.Path("ca.pem");
  shown.token_file = files_.Path("token");
  const auto connection = Open(shown);
  ASSERT_TRUE(connection.ok()) << connection.status();
  EXPECT_TRUE(Describe(connection->get()).ok());
  const std::string next = service::NewAccessToken();
  WriteTokens(next);
  EXPECT_EQ(Describe(connection->get()).code(), absl::StatusCode::kUnauthenticated);
  std::ofstream(files_.Path("token")) << next;
  EXPECT_TRUE(Describe(connection->get()).ok());
  const auto refused = (*connection)->Call(&v1::Models::Stub::CreateModel, v1::CreateModelRequest());
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("Models.CreateModel needs the role admin"));
}

TEST_F(CredentialsTest, WhatDoesNotFitIsSaidInWords) {
  files_.MakeCa("other");
  files_.Issue("stranger", "DNS:localhost", "other");
  server_.access.tls_client_ca = files_.Path("ca.pem");
  Start();
  EXPECT_THAT(Refusal({}), AllOf(HasSubstr("speaks TLS"), HasSubstr("--tls-ca")));
  Credentials shown;
  shown.tls_ca = files_.Path("other.pem");
  EXPECT_THAT(Refusal(shown), AllOf(HasSubstr("comes from no CA in"), HasSubstr("other.pem")));
  shown.tls_ca = files_.Path("ca.pem");
  EXPECT_THAT(Refusal(shown, "127.0.0.1"), HasSubstr("is for localhost, not for '127.0.0.1'"));
  shown.tls_cert = files_.Path("stranger.pem");
  shown.tls_key = files_.Path("stranger.key");
  EXPECT_THAT(Refusal(shown), AllOf(HasSubstr("hangs up when it is shown the client certificate"),
                                    HasSubstr("stranger.pem")));
  shown.tls_key = files_.Path("ca.key");
  EXPECT_THAT(Refusal(shown), HasSubstr("is not the private key of"));
  shown.tls_key.clear();
  EXPECT_THAT(Refusal(shown), HasSubstr("go together"));
}

TEST_F(CredentialsTest, TlsToAServerThatSpeaksPlainTextIsSaid) {
  server_.access = {};
  Start();
  Credentials shown;
  shown.tls_ca = files_.Path("ca.pem");
  EXPECT_THAT(Refusal(shown), HasSubstr("speaks plain text"));
  shown.tls_ca = files_.Path("token");
  EXPECT_THAT(Refusal(shown), HasSubstr("is no PEM file"));
  shown.tls_ca = files_.Path("absent.pem");
  EXPECT_THAT(Refusal(shown), HasSubstr("absent.pem"));
}

TEST_F(CredentialsTest, ATokenNeverCrossesANetworkInPlainText) {
  Credentials shown;
  shown.token = token_;
  const absl::Status status = MakeChannel("bench2:50051", shown, {}).status();
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("plain text"), HasSubstr("--tls-ca"), Not(HasSubstr(token_))));
  EXPECT_TRUE(MakeChannel("127.0.0.1:50051", shown, {}).ok());
  shown.token = token_ + "\n" + token_;
  EXPECT_THAT(std::string(MakeChannel("127.0.0.1:1", shown, {}).status().message()), Not(HasSubstr(token_)));
}

TEST(Credentials, WhatIsGivenWinsOverTheEnvironment) {
  ::setenv("TOUCHSTONE_TOKEN", "of-environment", 1);
  ::setenv("TOUCHSTONE_TLS_CA", "ca.pem", 1);
  Credentials given;
  given.token_file = "mine";
  EXPECT_EQ(WithEnvironment(given).token, "");
  EXPECT_EQ(WithEnvironment(given).tls_ca, "ca.pem");
  EXPECT_EQ(WithEnvironment({}).token, "of-environment");
  ::unsetenv("TOUCHSTONE_TOKEN");
  ::unsetenv("TOUCHSTONE_TLS_CA");
}

}  // namespace
}  // namespace touchstone::client
