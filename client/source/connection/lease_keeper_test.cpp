// Leases of the virtual source in this process, which grants them like a rig, and of a source made here.
#include "client/source/connection/lease_keeper.h"

#include <gmock/gmock.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <future>

#include "client/source/connection/leased_source.h"
#include "server/base/threads/manual_clock.h"

namespace touchstone::client {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class LeaseKeeperTest : public ::testing::Test {
 protected:
  LeaseKeeperTest() {
    ConnectionOptions options;
    options.embedded.clock = &clock_;
    auto connection = Connection::Open(options);
    EXPECT_TRUE(connection.ok()) << connection.status();
    connection_ = *std::move(connection);
    needs_lease_.set_lease_required(true);
  }
  v1::State State() { return *connection_->Call(&v1::Control::Stub::GetState, v1::GetStateRequest()); }
  absl::StatusOr<std::unique_ptr<LeaseKeeper>> Acquire(const std::string& holder, bool take = false) {
    LeaseOptions options;
    options.holder = holder;
    options.take = take;
    options.clock = &clock_;
    return LeaseKeeper::Acquire(connection_.get(), needs_lease_, options);
  }

  ManualClock clock_;
  std::unique_ptr<Connection> connection_;
  v1::DescribeResponse needs_lease_;
};

TEST_F(LeaseKeeperTest, DoesNothingAtASourceThatNeedsNone) {
  const auto source = connection_->Call(&v1::Source::Stub::Describe, v1::DescribeRequest());
  ASSERT_TRUE(source.ok());
  const auto keeper = LeaseKeeper::Acquire(connection_.get(), *source);
  ASSERT_TRUE(keeper.ok()) << keeper.status();
  EXPECT_FALSE((*keeper)->required());
  EXPECT_EQ((*keeper)->token(), "");
  EXPECT_TRUE((*keeper)->status().ok());
  EXPECT_TRUE((*keeper)->Follow(connection_.get()).ok());
  EXPECT_EQ(State().lease_epoch(), 0u);
}

TEST_F(LeaseKeeperTest, HoldsTheLeaseUntilItGoes) {
  {
    const auto keeper = Acquire("ana@bench2");
    ASSERT_TRUE(keeper.ok()) << keeper.status();
    EXPECT_NE((*keeper)->token(), "");
    EXPECT_EQ(State().lease_holder(), "ana@bench2");
  }
  EXPECT_EQ(State().lease_holder(), "") << "given back, not left to run out";
}

TEST_F(LeaseKeeperTest, AHolderIsAPersonAProgramAndAProcess) {
  const std::string process = " " + std::to_string(::getpid());
  EXPECT_THAT(LeaseHolder(), testing::MatchesRegex("[^ ]+@[^ ]+ client_source_test" + process))
      << "the executable";
  SetHolderProgram("rig-run");
  EXPECT_THAT(LeaseHolder(), testing::MatchesRegex("[^ ]+@[^ ]+ rig-run" + process));
  {
    const auto keeper = Acquire("");
    ASSERT_TRUE(keeper.ok()) << keeper.status();
    EXPECT_EQ(State().lease_holder(), LeaseHolder());
  }
  SetHolderProgram(std::string(1000, 'x'));
  EXPECT_EQ(LeaseHolder().size(), 256u);
  EXPECT_THAT(LeaseHolder(), testing::EndsWith("x" + process))
      << "what tells two programs apart is never cut";
  SetHolderProgram("");
}

TEST_F(LeaseKeeperTest, RefusesTellWhoHoldsItAndHowToTakeIt) {
  const auto ana = Acquire("ana@bench2");
  ASSERT_TRUE(ana.ok());
  // Who held it may be gone, and the lease is asked for until it would have run out by then; ana's is renewed.
  const Clock::Time asked = clock_.Now();
  auto asking = std::async(std::launch::async, [&] { return Acquire("ben@desk"); });
  clock_.PassUntil([&] { return asking.wait_for(std::chrono::seconds(0)) == std::future_status::ready; }, 2);
  const auto ben = asking.get();
  EXPECT_EQ(ben.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_GT(clock_.SecondsSince(asked), service::ServerOptions().lease_window_s);
  EXPECT_THAT(std::string(ben.status().message()), AllOf(HasSubstr("ana@bench2"), HasSubstr("--take-lease")));
}

TEST_F(LeaseKeeperTest, TellsItsHolderWhoTookTheLease) {
  std::atomic<int> losses{0};
  LeaseOptions options;
  options.holder = "ana@bench2";
  options.on_lost = [&](const absl::Status&) { ++losses; };
  options.clock = &clock_;
  const auto ana = LeaseKeeper::Acquire(connection_.get(), needs_lease_, options);
  ASSERT_TRUE(ana.ok());
  const auto ben = Acquire("ben@desk", true);
  ASSERT_TRUE(ben.ok()) << ben.status();
  clock_.PassUntil([&] { return losses > 0; });
  EXPECT_EQ((*ana)->status().code(), absl::StatusCode::kAborted);
  EXPECT_THAT(std::string((*ana)->status().message()), HasSubstr("ben@desk"));
  EXPECT_EQ(losses, 1);
  // It does not come back by itself, and does not take it back either.
  const absl::Status follow = (*ana)->Follow(connection_.get());
  EXPECT_EQ(follow.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(follow.message()), HasSubstr("ben@desk"));
  EXPECT_EQ(State().lease_holder(), "ben@desk");
}

TEST_F(LeaseKeeperTest, FollowsToANewLeaseOnceTheOldOneIsFree) {
  const auto ana = Acquire("ana@bench2");
  ASSERT_TRUE(ana.ok());
  const std::string before = (*ana)->token();
  v1::ReleaseLeaseRequest release;
  release.set_token(before);
  ASSERT_TRUE(connection_->Call(&v1::Control::Stub::ReleaseLease, release).ok());
  clock_.PassUntil([&] { return !(*ana)->status().ok(); });
  ASSERT_TRUE((*ana)->Follow(connection_.get()).ok());
  EXPECT_TRUE((*ana)->status().ok());
  EXPECT_NE((*ana)->token(), before);
  EXPECT_EQ(State().lease_holder(), "ana@bench2");
}

// A source that wants a lease, and that fails where a test wants it.
class FakeRig : public v1::Control::Service {
 public:
  class Touches : public v1::Source::Service {
   public:
    explicit Touches(FakeRig* rig) : rig_(rig) {}
    grpc::Status Describe(grpc::ServerContext*, const v1::DescribeRequest*,
                          v1::DescribeResponse* response) override {
      response->set_kind(v1::SOURCE_KIND_PHYSICAL);
      response->set_lease_required(true);
      response->set_max_touches_per_request(100);
      return grpc::Status::OK;
    }
    grpc::Status Touch(grpc::ServerContext* context, const v1::TouchRequest* request,
                       v1::TouchResponse* response) override {
      rig_->touch_tokens.push_back(request->lease_token());
      rig_->touch_ids.push_back(request->touch_ids_size() > 0 ? request->touch_ids(0) : "");
      if (rig_->failures-- > 0) return grpc::Status(grpc::StatusCode::UNAVAILABLE, "the arm is not there");
      if (rig_->hold) {
        rig_->touching.set_value();
        rig_->stop_called.get_future().wait();
      }
      if (rig_->stopped) return grpc::Status(grpc::StatusCode::ABORTED, "stopped");
      response->add_results();
      return grpc::Status::OK;
    }

   private:
    FakeRig* rig_;
  };

  FakeRig() : touches_(this) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    builder.RegisterService(&touches_);
    server_ = builder.BuildAndStart();
  }
  ~FakeRig() override { server_->Shutdown(std::chrono::system_clock::now()); }

  grpc::Status AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest* request,
                            v1::Lease* lease) override {
    lease->set_token("token" + std::to_string(++acquired));
    lease->set_holder(request->holder());
    lease->set_window_s(window_s);
    return grpc::Status::OK;
  }
  grpc::Status RenewLease(grpc::ServerContext*, const v1::RenewLeaseRequest* request,
                          v1::Lease* lease) override {
    ++renewed;
    if (silent) return grpc::Status(grpc::StatusCode::UNAVAILABLE, "unplugged");
    if (stale) return grpc::Status(grpc::StatusCode::ABORTED, "stale");
    lease->set_token(request->token());
    lease->set_window_s(window_s);
    return grpc::Status::OK;
  }
  grpc::Status ReleaseLease(grpc::ServerContext*, const v1::ReleaseLeaseRequest*,
                            v1::ReleaseLeaseResponse*) override {
    ++released;
    return grpc::Status::OK;
  }
  grpc::Status GetState(grpc::ServerContext*, const v1::GetStateRequest*, v1::State* state) override {
    state->set_state(stopped ? v1::SOURCE_STATE_STOPPED : v1::SOURCE_STATE_IDLE);
    return grpc::Status::OK;
  }
  grpc::Status Stop(grpc::ServerContext*, const v1::StopRequest* request, v1::StopResponse*) override {
    stop_reason = request->reason();
    if (!stopped.exchange(true)) stop_called.set_value();
    return grpc::Status::OK;
  }

  std::unique_ptr<Connection> Connect() const {
    ConnectionOptions options;
    options.servers = {"127.0.0.1:" + std::to_string(port_)};
    auto connection = Connection::Open(options);
    EXPECT_TRUE(connection.ok()) << connection.status();
    return *std::move(connection);
  }

  static constexpr double window_s = 2;
  std::atomic<int> acquired{0}, renewed{0}, released{0}, failures{0};
  std::atomic<bool> silent{false}, stale{false}, stopped{false};
  bool hold = false;  // the one touch of a test lasts until a stop
  std::promise<void> touching, stop_called;
  std::string stop_reason;
  std::vector<std::string> touch_tokens, touch_ids;

 private:
  Touches touches_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

v1::TouchRequest OneTouch(const std::string& id) {
  v1::TouchRequest request;
  request.set_object("lat20");
  request.add_touches();
  if (!id.empty()) request.add_touch_ids(id);
  return request;
}

std::unique_ptr<LeaseKeeper> AcquireAt(Connection* connection, const Clock& clock) {
  v1::DescribeResponse source;
  source.set_lease_required(true);
  LeaseOptions options;
  options.clock = &clock;
  return *LeaseKeeper::Acquire(connection, source, options);
}

TEST(LeaseKeeper, RenewsAsLongAsItLives) {
  FakeRig rig;
  const auto connection = rig.Connect();
  ManualClock clock;
  {
    const auto keeper = AcquireAt(connection.get(), clock);
    for (int renewals = 0; renewals < 10; ++renewals) {
      clock.AwaitWaiters();
      EXPECT_EQ(rig.renewed, renewals);
      EXPECT_NEAR(clock.AdvanceToFirst(), rig.window_s / 5, 1e-6);
    }
    clock.AwaitWaiters();
    EXPECT_TRUE(keeper->status().ok());
    EXPECT_EQ(rig.acquired, 1);
  }
  EXPECT_EQ(rig.released, 1);
}

TEST(LeaseKeeper, IsLostWhenTheSourceStaysSilentForTheWindow) {
  FakeRig rig;
  const auto connection = rig.Connect();
  ManualClock clock;
  const auto keeper = AcquireAt(connection.get(), clock);
  const Clock::Time acquired = clock.Now();
  rig.silent = true;
  clock.PassUntil([&] { return !keeper->status().ok(); });
  EXPECT_GT(clock.SecondsSince(acquired), rig.window_s);
  EXPECT_LT(clock.SecondsSince(acquired), 1.5 * rig.window_s);
  EXPECT_THAT(std::string(keeper->status().message()), HasSubstr("did not answer"));
  rig.silent = false;
  EXPECT_TRUE(keeper->Follow(connection.get()).ok());
  EXPECT_TRUE(keeper->status().ok());
  EXPECT_EQ(rig.acquired, 1) << "the old lease stands";
}

TEST(LeaseKeeper, NeverEndsAStopThatSomebodyElseCalled) {
  FakeRig rig;
  const auto connection = rig.Connect();
  ManualClock clock;
  const auto keeper = AcquireAt(connection.get(), clock);
  rig.stale = true;
  rig.stopped = true;
  clock.PassUntil([&] { return !keeper->status().ok(); });
  EXPECT_EQ(keeper->Follow(connection.get()).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(rig.acquired, 1);
}

TEST(LeasedSource, AsksForTheSameTouchAgainAfterALoss) {
  FakeRig rig;
  const auto connection = rig.Connect();
  ManualClock clock;
  LeasedSourceOptions options;
  options.clock = &clock;
  const auto source = LeasedSource::Open(connection.get(), options);
  ASSERT_TRUE(source.ok()) << source.status();
  EXPECT_EQ((*source)->touches_per_request(), 1u);
  rig.failures = 2;
  auto touching =
      std::async(std::launch::async, [&] { return (*source)->Touch(OneTouch("monday/lat20/7")); });
  // The touch waits between two tries, and the lease is renewed meanwhile.
  clock.PassUntil([&] { return touching.wait_for(std::chrono::seconds(0)) == std::future_status::ready; }, 2);
  const auto response = touching.get();
  ASSERT_TRUE(response.ok()) << response.status();
  EXPECT_EQ(rig.touch_ids, std::vector<std::string>(3, "monday/lat20/7"));
  EXPECT_EQ(rig.touch_tokens, std::vector<std::string>(3, "token1"));
}

TEST(LeasedSource, NeverRepeatsATouchWithoutAnId) {
  FakeRig rig;
  const auto connection = rig.Connect();
  const auto source = LeasedSource::Open(connection.get());
  ASSERT_TRUE(source.ok());
  rig.failures = 1;
  EXPECT_EQ((*source)->Touch(OneTouch("")).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(rig.touch_ids.size(), 1u);
}

TEST(LeasedSource, StopsTheMotionWhenItIsInterrupted) {
  FakeRig rig;
  rig.hold = true;
  const auto connection = rig.Connect();
  const auto source = LeasedSource::Open(connection.get());
  ASSERT_TRUE(source.ok());
  std::thread signal([&] {
    rig.touching.get_future().wait();
    (*source)->Interrupt("Ctrl-C");
  });
  const auto response = (*source)->Touch(OneTouch("a"));
  signal.join();
  EXPECT_EQ(response.status().code(), absl::StatusCode::kCancelled);
  EXPECT_TRUE(rig.stopped);
  EXPECT_EQ(rig.stop_reason, "Ctrl-C");
  EXPECT_EQ((*source)->Touch(OneTouch("b")).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(rig.touch_ids.size(), 1u) << "nothing is asked for after the interruption";
}

}  // namespace
}  // namespace touchstone::client
