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

  // But for one that was on its way already, in a thread that may not get the processor for long.
  void ExpectNoMoreAfter(double end_s) {
    ASSERT_TRUE(WaitFor([&] { return HostNowS() > end_s; }));
    const int sent = sent_;
    ASSERT_TRUE(WaitFor([&] { return HostNowS() > end_s + 2 * Heartbeats::kPermitS; }));
    EXPECT_LE(sent_, sent + 1);
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
  EXPECT_TRUE(WaitFor([&] {
    heartbeats_.Permit();
    return sent_ >= 10 && last_s_ > began_s + 3 * Heartbeats::kPermitS;
  }));
}

TEST_F(HeartbeatsTest, ASupervisorThatHangsHasNoneAfterItsPermit) {
  ASSERT_TRUE(WaitFor([&] {
    heartbeats_.Permit();
    return sent_ > 0;
  }));
  // The supervisor hangs from here on.
  ExpectNoMoreAfter(HostNowS() + Heartbeats::kPermitS);
}

TEST_F(HeartbeatsTest, TheEndOfAMotionEndsThem) {
  {
    const HeartbeatScope scope(&heartbeats_);
    ASSERT_TRUE(WaitFor([&] {
      heartbeats_.Permit();
      return sent_ > 0;
    }));
  }
  ExpectNoMoreAfter(HostNowS());
}

}  // namespace
}  // namespace touchstone::gateway
