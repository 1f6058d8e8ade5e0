#include "tests/hidden_effects/score/table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace touchstone::hidden {
namespace {

TEST(Table, IntervalsAreClopperPearsons) {
  // Nothing in n: 1 - 0.025^(1/n), by hand.
  EXPECT_EQ(Interval({0, 400}).first, 0);
  EXPECT_NEAR(Interval({0, 400}).second, 1 - std::pow(0.025, 1.0 / 400), 1e-12);
  EXPECT_NEAR(Interval({20, 20}).first, std::pow(0.025, 1.0 / 20), 1e-12);
  EXPECT_EQ(Interval({20, 20}).second, 1);
  // 8 of 10, from printed tables.
  EXPECT_NEAR(Interval({8, 10}).first, 0.4439, 1e-4);
  EXPECT_NEAR(Interval({8, 10}).second, 0.9748, 1e-4);
}

TEST(Table, SaysWhereATargetIsMissed) {
  Results results;
  results.diagnosis[{"nothing", "false claim"}] = {8, 400};
  results.bic[{"nothing", "false claim"}] = {100, 400};
  results.diagnosis[{"two", "all found, none added"}] = {95, 100};
  const std::string table = Table(results);
  EXPECT_THAT(table,
              testing::HasSubstr("| nothing | false claim | <= 1 | 400 | 2 | 0.867 - 3.9 | **miss** | 25 |"));
  EXPECT_THAT(table, testing::HasSubstr("| two | all found, none added | >= 90 | 100 | 95 |"));
  EXPECT_THAT(table, testing::HasSubstr("| pass |"));
}

}  // namespace
}  // namespace touchstone::hidden
