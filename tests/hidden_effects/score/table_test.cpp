#include "tests/hidden_effects/score/table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/hidden_effects/score/figures_table.h"

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

TEST(FiguresTable, AddsUpArmsAndSaysWhereTargetsAreMissed) {
  TrialResult result;
  Rates& rates = result.results.diagnosis;
  rates[{"nothing", "right"}] = rates[{"nothing", "honest"}] = {100, 100};
  rates[{"nothing", "confidently wrong"}] = {0, 100};
  rates[{"warm-up, weak", "right"}] = {5, 10};
  rates[{"warm-up, weak", "honest"}] = {8, 10};
  rates[{"warm-up, weak", "confidently wrong"}] = {2, 10};
  rates[{"warm-up, strong", "right"}] = rates[{"warm-up, strong", "honest"}] = {10, 10};
  rates[{"warm-up, strong", "confidently wrong"}] = {0, 10};
  rates[{"warm-up, weak", "unexplained by time"}] = {0, 10};
  rates[{"warm-up, strong", "unexplained by time"}] = {10, 10};
  result.full_set_seconds = {1, 1.5, 30};
  const std::string table = FiguresTable(result);
  EXPECT_THAT(table, testing::HasSubstr(
                         "| nothing | 100 | 100 (96.4 - 100) | 100 (96.4 - 100) | 0 (0 - 3.62) |  |  |"));
  EXPECT_THAT(table, testing::HasSubstr("| warm-up, weak | 10 | 50 (18.7 - 81.3) | 80 (44.4 - 97.5) | 20 "
                                        "(2.52 - 55.6) | **miss** |  |"));
  EXPECT_THAT(table, testing::HasSubstr("| confidently wrong, everything | <= 0.5 | 120 | 1.67 "));
  EXPECT_THAT(table, testing::HasSubstr("| confidently wrong, outside the catalogue | <= 2 | 20 | 10 "));
  // The weak arm does not count.
  EXPECT_THAT(table, testing::HasSubstr("with time first (not weak) | >= 90 | 10 | 100 "));
  EXPECT_THAT(table, testing::HasSubstr("on 1 of 2 arms outside the catalogue: **miss**"));
  EXPECT_THAT(table, testing::HasSubstr("1.5 s of one core in the median (target <= 2, pass), 30 s at worst "
                                        "(target <= 20, **miss**)"));
}

}  // namespace
}  // namespace touchstone::hidden
