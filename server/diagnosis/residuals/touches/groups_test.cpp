#include "server/diagnosis/residuals/touches/groups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "server/diagnosis/residuals/touches/worst_touches.h"
#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

GroupedErrors Group(const touches::SyntheticSet& set) {
  return GroupErrors(set.observations, set.residuals, touches::kSyntheticSigmaS);
}

TEST(ErrorGroups, EveryKindAddsUpToAllTouchesAndToTheWholeExcess) {
  const GroupedErrors grouped = Group(touches::EarlyOnSlopes());
  std::map<ErrorGroupKind, std::pair<int, double>> sums;
  for (const ErrorGroup& group : grouped.groups) {
    sums[group.kind].first += group.touches;
    sums[group.kind].second += group.share_of_excess_error;
  }
  ASSERT_EQ(sums.size(), 6u);
  for (const auto& [kind, sum] : sums) {
    EXPECT_EQ(sum.first, kind == ErrorGroupKind::kFinger ? 3 * 960 : 960) << static_cast<int>(kind);
    EXPECT_NEAR(sum.second, 1, 1e-9) << static_cast<int>(kind);
  }
}

TEST(ErrorGroups, OfNoiseHaveTheRmseSigma) {
  const GroupedErrors grouped = Group(touches::SyntheticSet(5, 48, 4, touches::kSyntheticSigmaS, 2));
  for (const ErrorGroup& group : grouped.groups)
    EXPECT_NEAR(group.rmse_s, touches::kSyntheticSigmaS, group.touches > 500 ? 0.0004 : 0.0011) << group.name;
}

TEST(ErrorGroups, OfALateFingerHaveTwoThirdsOfItAsItsBias) {
  touches::SyntheticSet set(2, 48, 4, touches::kSyntheticSigmaS, 3);
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 2] += 0.03;
  set.observations.time_s[77 * 3] -= 1;
  set.observations.time_s[99 * 3] -= 2;
  set.observations.used[99] = 0;
  set.Finish();
  EXPECT_THAT(Group(set).finger_bias_s,
              testing::ElementsAre(testing::Lt(-0.009), testing::Lt(-0.008), testing::Gt(0.019)));
}

TEST(WorstTouches, AreThoseThatCountWithTheLargestFirst) {
  touches::SyntheticSet set(2, 48, 4, touches::kSyntheticSigmaS, 3);
  set.observations.time_s[77 * 3] -= 1;
  set.observations.time_s[99 * 3] -= 2;
  set.observations.used[99] = 0;
  set.Finish();
  const auto worst = FindWorstTouches(set.observations, set.residuals);
  ASSERT_EQ(worst.size(), 10u);
  EXPECT_EQ(worst[0].touch, 77u);
  EXPECT_THAT(worst[0].residual_s, testing::ElementsAre(testing::DoubleEq(set.residuals[77 * 3]),
                                                        testing::DoubleEq(set.residuals[77 * 3 + 1]),
                                                        testing::DoubleEq(set.residuals[77 * 3 + 2])));
  EXPECT_GT(worst[0].norm_s, worst[1].norm_s);
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
