#include "server/diagnosis/residuals/touches/touch_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "server/diagnosis/residuals/touches/rules.h"
#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

// The synthetic predictions have no contact points; the table needs some.
touches::SyntheticSet WithContacts(touches::SyntheticSet set) {
  set.prediction.contact_m.clear();
  for (size_t cell = 0; cell < set.residuals.size(); ++cell)
    set.prediction.contact_m.push_back({0.001 * double(cell), 0, 0});
  return set;
}

TouchTable TableOf(const touches::SyntheticSet& set) {
  const auto slices = FindSlices(set.observations, set.prediction, set.residuals, touches::kSyntheticSigmaS);
  return MakeTouchTable(set.observations, set.prediction, set.residuals, set.residuals, slices, 0.03);
}

TEST(TouchTable, HoldsEveryTouchOfASmallSet) {
  const touches::SyntheticSet set =
      WithContacts(touches::SyntheticSet(2, 20, 3, touches::kSyntheticSigmaS, 3));
  const TouchTable table = TableOf(set);
  ASSERT_EQ(table.size(), 120);
  EXPECT_EQ(table.touches_in_all, 120);
  for (int n = 0; n < table.size(); ++n) {
    EXPECT_EQ(table.touch[n], set.observations.set->touch[set.observations.row[n]]);
    double mean_s = 0;
    for (int i = 0; i < 3; ++i) mean_s += table.simulated_s[n * 3 + i];
    EXPECT_NEAR(mean_s, 0, 1e-12);
  }
  EXPECT_EQ(table.residual_s, set.residuals);
}

TEST(TouchTable, GivesCovariatesOfFingersByCellAndOfTouchesByTouch) {
  const TouchTable table =
      TableOf(WithContacts(touches::SyntheticSet(2, 20, 3, touches::kSyntheticSigmaS, 3)));
  std::set<std::string> by_cell, by_touch;
  for (const TableCovariate& covariate : table.covariates)
    (covariate.values.size() == table.touch.size() ? by_touch : by_cell).insert(covariate.name);
  EXPECT_EQ(by_cell.count("incidence_deg"), 1u);
  EXPECT_EQ(by_touch.count("session_time_s"), 1u);
  EXPECT_EQ(by_touch.count("object"), 1u);
}

TEST(TouchTable, NamesTheCellsOfEverySlice) {
  const touches::SyntheticSet set = WithContacts(touches::EarlyOnSlopes());
  const auto slices = FindSlices(set.observations, set.prediction, set.residuals, touches::kSyntheticSigmaS);
  ASSERT_FALSE(slices.empty());
  const TouchTable table = TableOf(set);
  ASSERT_EQ(table.slice_cells.size(), slices.size());
  std::set<uint32_t> touched;
  double sum_s = 0;
  for (const uint32_t cell : table.slice_cells[0]) touched.insert(cell / 3), sum_s += table.residual_s[cell];
  EXPECT_EQ(touched.size(), size_t(slices[0].touches));
  EXPECT_NEAR(sum_s / table.slice_cells[0].size(), slices[0].mean_residual_s, 1e-9);
}

TEST(TouchTable, IsASampleOfWholePosesOfALargeSet) {
  const TouchTable table =
      TableOf(WithContacts(touches::SyntheticSet(5, 500, 4, touches::kSyntheticSigmaS, 8)));
  EXPECT_EQ(table.touches_in_all, 10000);
  EXPECT_GT(table.size(), kTouchResidualRules.max_table_touches * 3 / 4);
  EXPECT_LT(table.size(), kTouchResidualRules.max_table_touches * 5 / 4);
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
