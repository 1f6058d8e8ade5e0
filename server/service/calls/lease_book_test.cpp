// How long a lease lasts, to the moment; what it permits is tried by tests/conformance.
#include "server/service/calls/lease_book.h"

#include <gtest/gtest.h>

#include "server/base/threads/manual_clock.h"

namespace touchstone::service {
namespace {

constexpr double kWindowS = 2;

TEST(LeaseBook, ALeaseHoldsForItsWindowAndNoLonger) {
  ManualClock clock;
  LeaseBook leases(kWindowS, true, clock);
  const auto lease = leases.Acquire("ana@bench2", false);
  ASSERT_TRUE(lease.ok()) << lease.status();
  EXPECT_EQ(lease->window_s(), kWindowS);
  clock.Advance(kWindowS - 1e-6);
  EXPECT_TRUE(leases.Check(lease->token()).ok());
  EXPECT_EQ(leases.Holder(), "ana@bench2");
  EXPECT_EQ(leases.Acquire("ben@desk", false).status().code(), absl::StatusCode::kFailedPrecondition);
  clock.Advance(1e-6);
  EXPECT_EQ(leases.Check(lease->token()).code(), absl::StatusCode::kAborted);
  EXPECT_EQ(leases.Renew(lease->token()).status().code(), absl::StatusCode::kAborted);
  EXPECT_EQ(leases.Release(lease->token()).code(), absl::StatusCode::kAborted);
  EXPECT_EQ(leases.Holder(), "");
  EXPECT_TRUE(leases.Acquire("ben@desk", false).ok());
}

TEST(LeaseBook, ARenewalBeginsTheWindowAnew) {
  ManualClock clock;
  LeaseBook leases(kWindowS, true, clock);
  const std::string token = leases.Acquire("ana@bench2", false)->token();
  for (int k = 0; k < 3; ++k) {
    clock.Advance(0.75 * kWindowS);
    EXPECT_TRUE(leases.Renew(token).ok());
  }
  clock.Advance(kWindowS);
  EXPECT_FALSE(leases.Renew(token).ok());
}

}  // namespace
}  // namespace touchstone::service
