#include "server/service/core/admission.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "server/base/sanitizers.h"

namespace touchstone::service {
namespace {

using testing::HasSubstr;

TEST(Client, IsItsAddressWithoutThePort) {
  EXPECT_EQ(ClientOfPeer("ipv4:10.0.0.7:4711"), "ipv4:10.0.0.7");
  EXPECT_EQ(ClientOfPeer("ipv6:%5B::1%5D:4711"), "ipv6:%5B::1%5D");
  EXPECT_EQ(ClientOfPeer("inproc"), "inproc");
  EXPECT_EQ(ClientOfPeer("unix:/run/a.sock"), "unix");
}

TEST(Places, AreLimitedTogetherAndForEachClient) {
  Places places("streams run", "max_streams", 3, "max_streams_per_client", 2);
  std::vector<Places::Place> taken;
  const auto take = [&](const char* client) {
    auto place = places.Take(client);
    if (place.ok()) taken.push_back(*std::move(place));
    return std::string(place.status().message());
  };
  EXPECT_EQ(take("a"), "");
  EXPECT_EQ(take("a"), "");
  EXPECT_EQ(take("a"),
            "for a 2 streams run already (max_streams_per_client = 2): try again later, or at another one");
  EXPECT_EQ(take("b"), "");
  EXPECT_THAT(take("c"), HasSubstr("3 streams run already (max_streams = 3)"));
  EXPECT_EQ(places.taken(), 3u);
  taken.clear();
  EXPECT_EQ(places.taken(), 0u);
  EXPECT_EQ(take("c"), "");
}

TEST(MemoryBudget, IsGivenBackWithTheReservation) {
  MemoryBudget budget(1000);
  budget.Begin();
  {
    const auto most = budget.Reserve(uint64_t{900} << 20);
    EXPECT_TRUE(most.ok()) << most.status();
    const auto more = budget.Reserve(uint64_t{200} << 20);
    EXPECT_TRUE(absl::IsResourceExhausted(more.status()));
    EXPECT_THAT(std::string(more.status().message()), HasSubstr("max_memory_mib = 1000"));
  }
  EXPECT_TRUE(budget.Reserve(uint64_t{200} << 20).ok());
}

// What nobody reserved counts too: pictures that were unpacked, results.
TEST(MemoryBudget, IsUsedUpByWhatTheProcessHas) {
  MemoryBudget budget(50);
  budget.Begin();
  EXPECT_TRUE(budget.Reserve(0).ok());
  std::vector<char> large(100 << 20, 'x');
  EXPECT_FALSE(budget.Reserve(0).ok());
  EXPECT_EQ(large[12345], 'x');
  large = std::vector<char>();
  // A sanitizer keeps what was freed for a while.
  if (!kUnderSanitizers) {
    EXPECT_TRUE(budget.Reserve(0).ok());
  }
}

TEST(MemoryBudget, IsHalfOfTheMachineUnlessItIsSet) {
  EXPECT_GT(MemoryBudget(0).bytes(), uint64_t{64} << 20);
  EXPECT_EQ(MemoryBudget(3).bytes(), uint64_t{3} << 20);
}

}  // namespace
}  // namespace touchstone::service
