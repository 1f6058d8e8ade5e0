// A process that nobody reaches is told from a busy one and from one that refuses.
#include "server/service/channel/self_probe.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <future>
#include <string>

#include "server/base/test_tier.h"
#include "server/base/threads/manual_clock.h"
#include "server/service/rpc/server.h"

namespace touchstone::service {
namespace {

// A port on which the system takes connections and nobody ever looks at them.
class SilentListener {
 public:
  SilentListener() : file_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(file_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(file_, 100), 0);
    ::getsockname(file_, reinterpret_cast<sockaddr*>(&address), &size);
    address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  }
  ~SilentListener() { ::close(file_); }
  const std::string& address() const { return address_; }
  // Until somebody has connected.
  void WaitForACaller() const {
    pollfd calls{file_, POLLIN, 0};
    EXPECT_EQ(::poll(&calls, 1, 60'000), 1);
  }

 private:
  const int file_;
  std::string address_;
};

TEST(SelfProbe, EndsWhatTakesConnectionsAndAnswersNone) {
  const SilentListener listener;
  ManualClock clock;
  std::atomic<int> ends{0};
  std::promise<void> ended;
  const SelfProbe probe(
      listener.address(), false, 60, 0.05,
      [&] {
        ++ends;
        ended.set_value();
      },
      SelfProbe::kUnanswered, clock);
  for (int question = 0; question < SelfProbe::kUnanswered; ++question) {
    EXPECT_EQ(clock.AdvanceToFirst(), 60);
    if (question + 1 < SelfProbe::kUnanswered) clock.AwaitWaiters();  // it was not answered
    EXPECT_EQ(ends, 0) << "not before the last question went unanswered";
  }
  ended.get_future().wait();
  EXPECT_EQ(ends, 1);
}

// gRPC by itself gives up connecting after 20 s, which is no answer either.
TEST(SelfProbe, EndsWhatIsSilentForLongerThanGrpcWouldTryToConnect) {
  TOUCHSTONE_SECOND_TIER("long: gRPC's own limit is 20 s of the machine's time");
  const SilentListener listener;
  std::promise<void> ended;
  const SelfProbe probe(
      listener.address(), false, 0.05, 21, [&] { ended.set_value(); }, 1);
  ended.get_future().wait();
}

// A proxy of the environment says nothing about this server, here one that refuses.
TEST(SelfProbe, AsksThisMachineAndNoProxy) {
  const SilentListener listener;
  ManualClock clock;
  std::promise<void> ended;
  ::setenv("http_proxy", "http://127.0.0.1:1", 1);
  {
    const SelfProbe probe(
        listener.address(), false, 60, 0.05, [&] { ended.set_value(); }, 1, clock);
    clock.AdvanceToFirst();
    listener.WaitForACaller();
    ended.get_future().wait();
  }
  ::unsetenv("http_proxy");
}

TEST(SelfProbe, ThatIsOverDoesNotWaitForItsAnswer) {
  const SilentListener listener;
  std::atomic<int> ends{0};
  const auto begin = std::chrono::steady_clock::now();
  {
    const SelfProbe probe(listener.address(), false, 0.001, 3600, [&] { ++ends; });
    listener.WaitForACaller();
  }
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::minutes(30));
  EXPECT_EQ(ends, 0);
}

// Also one that takes no more of its connections says so at once: that is an answer.
TEST(SelfProbe, LeavesAServerAloneThatAnswersOrRefuses) {
  ServerOptions options;
  options.listen = "127.0.0.1:0";
  options.supershape_triangles = 500;
  options.threads = 1;
  auto server = Server::Start(options).value();
  ManualClock clock;
  std::atomic<int> ends{0};
  const SelfProbe probe(
      OwnAddress(options.listen, server->port()), false, 60, 600, [&] { ++ends; }, SelfProbe::kUnanswered,
      clock);
  const auto let_it_ask = [&] {
    for (int question = 0; question < 2 * SelfProbe::kUnanswered; ++question) clock.AdvanceToFirst();
    clock.AwaitWaiters();  // the last one is over, and it goes on
  };
  let_it_ask();
  server.reset();  // nobody listens there any more
  let_it_ask();
  EXPECT_EQ(ends, 0);
}

TEST(SelfProbe, AsksWhereThisMachineReachesTheServer) {
  EXPECT_EQ(OwnAddress("127.0.0.1:0", 50051), "127.0.0.1:50051");
  EXPECT_EQ(OwnAddress("0.0.0.0:0", 50051), "127.0.0.1:50051");
  EXPECT_EQ(OwnAddress("[::]:50051", 50051), "127.0.0.1:50051");
  EXPECT_EQ(OwnAddress("10.0.0.7:50051", 50051), "10.0.0.7:50051");
  EXPECT_EQ(OwnAddress("unix:/run/touchstone", 0), "unix:/run/touchstone");
}

}  // namespace
}  // namespace touchstone::service
