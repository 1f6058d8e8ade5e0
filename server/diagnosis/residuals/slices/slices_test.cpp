#include "server/diagnosis/residuals/slices/slices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

std::vector<ErrorSlice> Slices(const touches::SyntheticSet& set) {
  return FindSlices(set.observations, set.prediction, set.residuals, touches::kSyntheticSigmaS);
}

TEST(ErrorSlices, NoiseAloneHasNoSlices) {
  int claims = 0;
  for (int seed = 0; seed < 100; ++seed)
    claims += !Slices(touches::SyntheticSet(5, 48, 4, touches::kSyntheticSigmaS, seed)).empty();
  EXPECT_LE(claims, 1);
}

TEST(ErrorSlices, ABiasBeyondAnAngleIsFoundThereWithItsSignAndSize) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 1);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i)
      if (set.IncidenceDeg(k, i) > 20) set.observations.time_s[k * 3 + i] -= 0.03;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_THAT(slices[0].conditions, testing::StartsWith("incidence > "));
  EXPECT_THAT(slices[0].conditions, testing::EndsWith(" deg"));
  EXPECT_THAT(slices[0].words, testing::StartsWith("contact too early by "));
  EXPECT_LT(slices[0].mean_residual_s, -0.005);
  EXPECT_GT(slices[0].share_of_excess_error, 0.4);
  EXPECT_GT(slices[0].touches, 400);
}

TEST(ErrorSlices, OneFingerOfOneObjectIsTwoConditions) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 2);
  for (int k = 0; k < set.size(); ++k)
    if (set.observations.object[k] == 3) set.observations.time_s[k * 3 + 2] += 0.03;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  std::vector<std::string> names;
  for (const ErrorSlice& slice : slices) names.push_back(slice.conditions);
  EXPECT_THAT(names, testing::Contains("object = object3 and finger = r"));
  const size_t at = std::find(names.begin(), names.end(), "object = object3 and finger = r") - names.begin();
  EXPECT_EQ(slices[at].touches, 192);
  EXPECT_NEAR(slices[at].mean_residual_s, 0.020, 0.0015);
  EXPECT_NEAR(slices[at].share_of_excess_error, 2.0 / 3, 0.05);
}

TEST(ErrorSlices, TheFirstFingerIsSaidInWords) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 3);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i)
      if (i != set.prediction.first_finger[k]) set.observations.time_s[k * 3 + i] += 0.015;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_EQ(slices[0].conditions, "first finger");
  EXPECT_NEAR(slices[0].share_of_excess_error, 2.0 / 3, 0.03);
  EXPECT_NEAR(slices[0].mean_residual_s, -0.010, 0.0005);
}

TEST(ErrorSlices, AWeakBiasOfOneFingerIsSeenAlthoughTheExcessIsSmall) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 4);
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 1] += 0.3 * touches::kSyntheticSigmaS;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_EQ(slices[0].conditions, "finger = m");
}

TEST(ErrorSlices, ATouchThatIsLeftOutCountsNowhere) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 5);
  for (int k = 0; k < set.size(); ++k)
    if (set.observations.object[k] == 2) {
      set.observations.time_s[k * 3] += 1;
      set.observations.used[k] = 0;
    }
  set.Finish();
  EXPECT_THAT(Slices(set), testing::IsEmpty());
}

TEST(ErrorSlices, AFewTouchesAndMissingFingersAreNoTrouble) {
  for (const int poses : {1, 2, 5, 12}) {
    touches::SyntheticSet set(1, poses, 4, touches::kSyntheticSigmaS, 6);
    for (int k = 0; k < set.size(); k += 3) set.observations.time_s[k * 3 + k % 2] = NAN;
    for (int i = 0; i < 3; ++i) set.observations.time_s[i] = NAN;
    set.Finish();
    EXPECT_THAT(Slices(set), testing::IsEmpty()) << poses;
  }
}

TEST(ErrorSlices, CountsAllTouchesOfALargeSet) {
  touches::SyntheticSet set(5, 500, 40, touches::kSyntheticSigmaS, 7);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i)
      if (set.IncidenceDeg(k, i) > 20) set.observations.time_s[k * 3 + i] -= 0.03;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_GT(slices[0].touches, 30000);  // more than the search reads
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
