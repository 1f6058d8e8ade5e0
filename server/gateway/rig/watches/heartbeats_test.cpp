#include "server/gateway/rig/watches/heartbeats.h"

#include <gtest/gtest.h>

#include <atomic>

#include "server/base/threads/manual_clock.h"

namespace touchstone::gateway {
namespace {

class HeartbeatsTest : public testing::Test {
 protected:
  HeartbeatsTest() { clock_.AwaitWaiters(); }

  // What the thread does at once, now and after so much time, is done.
  int SentAfter(double seconds) {
    clock_.Advance(seconds);
    clock_.AwaitWaiters();
    return sent_;
  }
  // The permit wakes the thread: until it has sent and waits again.
  void PermitAndSend() {
    const int sent = sent_;
    heartbeats_.Permit();
    while (sent_ == sent) std::this_thread::yield();
    clock_.AwaitWaiters();
  }
  // Whenever one could come within two permits.
  void ExpectNoMore() {
    const int sent = sent_;
    for (double passed_s = 0; passed_s < 2 * Heartbeats::kPermitS; passed_s += Heartbeats::kPeriodS)
      EXPECT_EQ(SentAfter(Heartbeats::kPeriodS), sent) << passed_s << " s later";
  }

  ManualClock clock_;
  std::atomic<int> sent_{0};
  Heartbeats heartbeats_{[this] { ++sent_; }, clock_};
};

TEST_F(HeartbeatsTest, NobodyWhoSupervisesMeansNoHeartbeat) {
  ExpectNoMore();
  EXPECT_EQ(sent_, 0);
}

TEST_F(HeartbeatsTest, TheyGoOnWhileThePermitIsRenewedWhateverTheSupervisorWaitsFor) {
  PermitAndSend();
  for (double passed_s = 0; passed_s < 3 * Heartbeats::kPermitS; passed_s += Heartbeats::kPeriodS) {
    const int sent = sent_;
    heartbeats_.Permit();
    EXPECT_EQ(SentAfter(Heartbeats::kPeriodS), sent + 1) << passed_s << " s later";
  }
}

TEST_F(HeartbeatsTest, ASupervisorThatHangsHasNoneAfterItsPermit) {
  PermitAndSend();
  // The supervisor hangs from here on. One heartbeat was at the time of the permit.
  const auto permitted = clock_.Now();
  while (clock_.SecondsSince(permitted) < Heartbeats::kPermitS - 1.5 * Heartbeats::kPeriodS) {
    const int sent = sent_;
    EXPECT_EQ(SentAfter(Heartbeats::kPeriodS), sent + 1);
  }
  SentAfter(2 * Heartbeats::kPeriodS);
  ExpectNoMore();
  PermitAndSend();  // and again, once the supervisor goes on
}

TEST_F(HeartbeatsTest, TheEndOfAMotionEndsThem) {
  {
    const HeartbeatScope scope(&heartbeats_);
    while (sent_ == 0) std::this_thread::yield();
    clock_.AwaitWaiters();
  }
  ExpectNoMore();
}

}  // namespace
}  // namespace touchstone::gateway
