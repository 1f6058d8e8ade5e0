#include "server/gateway/rig/heartbeats.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>

#include "server/gateway/timing/host_time.h"

namespace touchstone::gateway {
namespace {

using timing::HostNowS;

class HeartbeatsTest : public testing::Test {
 protected:
  bool WaitFor(const std::function<bool()>& done) {
    for (const double until_s = HostNowS() + 30; HostNowS() < until_s;) {
      if (done()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }

  std::atomic<int> sent_{0};
  std::atomic<double> last_s_{0};
  Heartbeats heartbeats_{[this] {
    last_s_ = HostNowS();
    ++sent_;
  }};
};

TEST_F(HeartbeatsTest, NobodyWhoSupervisesMeansNoHeartbeat) {
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(sent_, 0);
}

TEST_F(HeartbeatsTest, TheyGoOnWhileThePermitIsRenewedWhateverTheSupervisorWaitsFor) {
  const double began_s = HostNowS();
  while (HostNowS() < began_s + 4 * Heartbeats::kPermitS) {
    heartbeats_.Permit();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_GT(last_s_, began_s + 3 * Heartbeats::kPermitS);
  EXPECT_TRUE(WaitFor([&] { return sent_ >= 10; }));
}

TEST_F(HeartbeatsTest, ASupervisorThatHangsHasNoneAfterItsPermit) {
  heartbeats_.Permit();
  const double permitted_s = HostNowS();
  ASSERT_TRUE(WaitFor([&] { return sent_ > 0; }));
  // The supervisor hangs from here on: its last heartbeat lies within the permit, however late this thread looks.
  ASSERT_TRUE(WaitFor([&] { return HostNowS() > permitted_s + 3 * Heartbeats::kPermitS; }));
  const int sent = sent_;
  EXPECT_LT(last_s_, permitted_s + 2 * Heartbeats::kPermitS);
  ASSERT_TRUE(WaitFor([&] { return HostNowS() > permitted_s + 4 * Heartbeats::kPermitS; }));
  EXPECT_EQ(sent_, sent);
}

TEST_F(HeartbeatsTest, TheEndOfAMotionEndsThem) {
  { const HeartbeatScope scope(&heartbeats_); }
  std::this_thread::sleep_for(std::chrono::milliseconds(5 * static_cast<int>(1000 * Heartbeats::kPeriodS)));
  const int sent = sent_;
  const double began_s = HostNowS();
  ASSERT_TRUE(WaitFor([&] { return HostNowS() > began_s + Heartbeats::kPermitS; }));
  EXPECT_EQ(sent_, sent);
}

}  // namespace
}  // namespace touchstone::gateway
