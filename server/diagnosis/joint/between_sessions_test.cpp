#include "server/diagnosis/joint/between_sessions.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::joint {
namespace {

std::vector<SessionEstimate> Drawn(int sessions, double between, double std_error, uint64_t seed) {
  RandomStream random(seed, RandomDomain::kTest);
  std::vector<SessionEstimate> drawn;
  for (int s = 0; s < sessions; ++s)
    drawn.push_back({1 + between * random.Normal() + std_error * random.Normal(), std_error});
  return drawn;
}

TEST(BetweenSessions, IsNothingWhereSessionsAgree) {
  const BetweenSessions between = EstimateBetweenSessions({{1, 0.1}, {1.05, 0.1}, {0.95, 0.1}});
  EXPECT_EQ(between.std_deviation, 0);
  EXPECT_NEAR(between.mean, 1, 1e-12);
  EXPECT_NEAR(between.mean_std_error, 0.1 / std::sqrt(3), 1e-12);
}

// Equal standard errors: the variance of the values less that of each.
TEST(BetweenSessions, IsTheVarianceBeyondTheStandardErrors) {
  const BetweenSessions between = EstimateBetweenSessions({{0, 0.5}, {2, 0.5}, {4, 0.5}});
  EXPECT_NEAR(between.std_deviation, std::sqrt(4 - 0.25), 1e-12);
  EXPECT_NEAR(between.mean, 2, 1e-12);
}

int CountOutside(const std::vector<SessionEstimate>& sessions) {
  int outside = 0;
  for (const ControlLimits& limits : MakeControlChart(sessions).limits) outside += limits.outside;
  return outside;
}

TEST(ControlChart, LeavesOneOfHundredSessionsOutsideAtMost) {
  int outside = 0;
  for (uint64_t seed = 1; seed <= 50; ++seed) outside += CountOutside(Drawn(20, 0.2, 0.1, seed));
  EXPECT_LE(outside, 50 * 20 / 100);
}

// One session must widen neither its own limits nor the others'.
TEST(ControlChart, NamesTheSessionThatMovedAndKeepsTheOthersLimits) {
  std::vector<SessionEstimate> sessions = Drawn(8, 0.02, 0.02, 3);
  const ControlChart steady = MakeControlChart(sessions);
  sessions[5].value += 0.5;
  const ControlChart chart = MakeControlChart(sessions);
  for (size_t s = 0; s < sessions.size(); ++s) {
    EXPECT_EQ(chart.limits[s].outside, s == 5) << s;
    EXPECT_LT(chart.limits[s].upper - chart.limits[s].lower,
              2 * (steady.limits[s].upper - steady.limits[s].lower));
  }
  EXPECT_LT(chart.inside.std_deviation, 0.05);
}

TEST(ControlChart, HasNoLimitsForThreeSessions) {
  EXPECT_TRUE(MakeControlChart(Drawn(3, 0.2, 0.1, 1)).limits.empty());
}

}  // namespace
}  // namespace touchstone::diagnosis::joint
