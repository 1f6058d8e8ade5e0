// Calls at servers made here that fail as a test wants it: what is asked again, where, and for how long.
#include "client/source/connection/connection.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <future>

#include "server/base/threads/manual_clock.h"

namespace touchstone::client {
namespace {

using testing::HasSubstr;

// Fails at the first calls, and answers then.
class FailingSource : public v1::Source::Service {
 public:
  explicit FailingSource(int failures = 0,
                         grpc::Status failure = {grpc::StatusCode::UNAVAILABLE, "unplugged"})
      : failures_(failures), failure_(std::move(failure)) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~FailingSource() override { server_->Shutdown(std::chrono::system_clock::now()); }

  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  grpc::Status Describe(grpc::ServerContext*, const v1::DescribeRequest*,
                        v1::DescribeResponse* answer) override {
    answer->set_version(address());
    return ++calls <= failures_ ? failure_ : grpc::Status::OK;
  }

  std::atomic<int> calls{0};

 private:
  const int failures_;
  const grpc::Status failure_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

constexpr int kAlways = 1 << 30;

std::unique_ptr<Connection> ConnectTo(std::vector<std::string> servers, const Clock* clock = &SteadyClock()) {
  ConnectionOptions options;
  options.servers = std::move(servers);
  options.connect_timeout_s = 60;  // what is gone is refused at once
  options.clock = clock;
  return Connection::Open(std::move(options)).value();
}

absl::StatusOr<v1::DescribeResponse> DescribeBy(Connection* connection) {
  return connection->Call(&v1::Source::Stub::Describe, v1::DescribeRequest());
}

// As a server that drains, was killed, cancelled what was left, or has no room.
TEST(Connection, MakesALostCallAgainAtTheNextServer) {
  for (const grpc::Status& failure :
       {grpc::Status(grpc::StatusCode::UNAVAILABLE, "Socket closed"),
        grpc::Status(grpc::StatusCode::INTERNAL, "Received RST_STREAM"),
        grpc::Status(grpc::StatusCode::UNKNOWN, "Stream removed"),
        grpc::Status(grpc::StatusCode::CANCELLED, "CANCELLED"),
        grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "try again later")}) {
    FailingSource first(kAlways, failure), second;
    const auto connection = ConnectTo({first.address(), second.address()});
    const auto answer = DescribeBy(connection.get());
    ASSERT_TRUE(answer.ok()) << answer.status();
    EXPECT_EQ(answer->version(), second.address());
    EXPECT_EQ(connection->address(), second.address());
    EXPECT_EQ(first.calls, 1);
  }
}

TEST(Connection, MakesALostCallAgainAtTheSameServerWhereThereIsNoOther) {
  FailingSource only(2);
  const auto connection = ConnectTo({only.address()});
  EXPECT_TRUE(DescribeBy(connection.get()).ok());
  EXPECT_EQ(only.calls, 3);
}

TEST(Connection, DoesNotRepeatWhatWasRefused) {
  FailingSource first(kAlways, {grpc::StatusCode::INVALID_ARGUMENT, "no such object"}), second;
  const auto connection = ConnectTo({first.address(), second.address()});
  EXPECT_TRUE(absl::IsInvalidArgument(DescribeBy(connection.get()).status()));
  EXPECT_EQ(first.calls + second.calls, 1);
}

TEST(Connection, DoesNotRepeatWhatMayBeDoneOnce) {
  FailingSource first(kAlways), second;
  const auto connection = ConnectTo({first.address(), second.address()});
  const auto answer = connection->CallOnce(&v1::Source::Stub::Describe, v1::DescribeRequest());
  EXPECT_TRUE(absl::IsUnavailable(answer.status()));
  EXPECT_EQ(first.calls + second.calls, 1);
}

TEST(Connection, GivesACallUpAfterItsTime) {
  FailingSource first(kAlways), second(kAlways);
  ManualClock clock;
  const auto connection = ConnectTo({first.address(), second.address()}, &clock);
  const Clock::Time begin = clock.Now();
  auto call = std::async(std::launch::async, [&] { return DescribeBy(connection.get()).status(); });
  clock.PassUntil([&] { return call.wait_for(std::chrono::seconds(0)) == std::future_status::ready; });
  EXPECT_TRUE(absl::IsUnavailable(call.get()));
  EXPECT_NEAR(clock.SecondsSince(begin), kRetryForS, 1e-6);
  EXPECT_GE(first.calls, kRetryForS / kMaxPauseS);
}

// A machine that hangs: the system takes connections, and nobody looks at them.
TEST(Connection, GoesOnToTheNextServerWhereOneIsSilent) {
  const int silent = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(silent, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(silent, 100), 0);
  ::getsockname(silent, reinterpret_cast<sockaddr*>(&address), &size);
  FailingSource second;
  ConnectionOptions options;
  options.servers = {"127.0.0.1:" + std::to_string(ntohs(address.sin_port)), second.address()};
  options.connect_timeout_s = 0.2;
  options.wait_s = 60;  // a busy machine may make the second one late as well
  const auto connection = Connection::Open(options);
  ASSERT_TRUE(connection.ok()) << connection.status();
  EXPECT_EQ((*connection)->address(), second.address());
  ::close(silent);
}

TEST(Connection, SaysWhichProxyAServerWasNotReachedThrough) {
  ::setenv("http_proxy", "http://ana:secret@127.0.0.1:1", 1);
  ConnectionOptions options;
  options.servers = {"bench2.touchstone.test:50051"};
  const std::string words(Connection::Open(options).status().message());
  ::unsetenv("http_proxy");
  EXPECT_THAT(
      words, HasSubstr("no connection to bench2.touchstone.test:50051 through the proxy http://127.0.0.1:1"));
  EXPECT_THAT(words, testing::Not(HasSubstr("secret")));
}

TEST(Retry, TriesTheNextServerAtOnceAndPausesAfterEachRound) {
  ManualClock clock;
  Retry retry(3, 1000, clock);
  double longest_s = kFirstPauseS;
  for (int round = 0; round < 10; ++round) {
    EXPECT_EQ(retry.PauseAfter(1), 0);
    const double pause_s = retry.PauseAfter(2).value();
    EXPECT_LE(pause_s, longest_s);
    EXPECT_GE(pause_s, kMinPauseShare * longest_s);
    longest_s = std::min(2 * longest_s, kMaxPauseS);
  }
}

TEST(Retry, EndsAfterAWholeRoundOnceItsTimeIsOver) {
  ManualClock clock;
  Retry retry(2, 0.05, clock);
  EXPECT_EQ(retry.PauseAfter(1), 0);
  EXPECT_LE(retry.PauseAfter(1).value(), 0.05) << "no longer than what is left";
  clock.Advance(1);
  EXPECT_EQ(retry.PauseAfter(1), 0) << "the second server has not been asked yet";
  EXPECT_EQ(retry.PauseAfter(1), std::nullopt);
}

}  // namespace
}  // namespace touchstone::client
