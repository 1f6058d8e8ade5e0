// The two tiers of tests. deploy/test runs the first; deploy/test --all, which sets TOUCHSTONE_TEST_TIER=all, runs both.
// Second are tests that are statistical (many sets), repeated (the same code over another table) or long.
#pragma once

#include <cstdlib>
#include <cstring>

#include <gtest/gtest.h>

namespace touchstone {

inline bool SecondTierRuns() {
  const char* tier = std::getenv("TOUCHSTONE_TEST_TIER");
  return tier != nullptr && std::strcmp(tier, "all") == 0;
}

}  // namespace touchstone

// The first statement of a test of the second tier, or of its fixture's SetUp(). `why` begins with the kind:
// "statistical: 40 sets with hidden effects". deploy/test counts what was left out by these words.
#define TOUCHSTONE_SECOND_TIER(why)                                                \
  do {                                                                             \
    if (!::touchstone::SecondTierRuns()) GTEST_SKIP() << "second tier: " << (why); \
  } while (false)
