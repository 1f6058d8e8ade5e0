#include "server/diagnosis/residuals/slices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/made_up_test_set.h"

namespace touchstone {
namespace {

constexpr double kSigmaS = 0.005;

std::vector<v1::Slice> Slices(const MadeUpSet& set) {
  return FindSlices(set.observations, set.prediction, set.residuals, kSigmaS);
}

TEST(Where, NoiseAloneHasNoSlices) {
  int claims = 0;
  for (int seed = 0; seed < 100; ++seed) claims += !Slices(MadeUpSet(5, 48, 4, kSigmaS, seed)).empty();
  EXPECT_LE(claims, 1);
}

TEST(Where, ABiasBeyondAnAngleIsFoundThereWithItsSignAndSize) {
  MadeUpSet set(5, 48, 4, kSigmaS, 1);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i)
      if (set.IncidenceDeg(k, i) > 20) set.observations.time_s[k * 3 + i] -= 0.03;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_THAT(slices[0].slice(), testing::StartsWith("incidence > "));
  EXPECT_THAT(slices[0].slice(), testing::EndsWith(" deg"));
  EXPECT_THAT(slices[0].words(), testing::StartsWith("contact too early by "));
  EXPECT_LT(slices[0].mean_residual_us(), -5000);
  EXPECT_GT(slices[0].share_of_excess_error(), 0.4);
  EXPECT_GT(slices[0].touches(), 400u);
}

TEST(Where, OneFingerOfOneObjectIsTwoConditions) {
  MadeUpSet set(5, 48, 4, kSigmaS, 2);
  for (int k = 0; k < set.size(); ++k)
    if (set.observations.object[k] == 3) set.observations.time_s[k * 3 + 2] += 0.03;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  std::vector<std::string> names;
  for (const v1::Slice& slice : slices) names.push_back(slice.slice());
  EXPECT_THAT(names, testing::Contains("object = object3 and finger = r"));
  const size_t at = std::find(names.begin(), names.end(), "object = object3 and finger = r") - names.begin();
  EXPECT_EQ(slices[at].touches(), 192u);
  EXPECT_NEAR(slices[at].mean_residual_us(), 20000, 1500);
  EXPECT_NEAR(slices[at].share_of_excess_error(), 2.0 / 3, 0.05);
}

TEST(Where, TheFirstFingerIsSaidInWords) {
  MadeUpSet set(5, 48, 4, kSigmaS, 3);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i)
      if (i != set.prediction.first_finger[k]) set.observations.time_s[k * 3 + i] += 0.015;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_EQ(slices[0].slice(), "first finger");
  EXPECT_NEAR(slices[0].share_of_excess_error(), 2.0 / 3, 0.03);
  EXPECT_NEAR(slices[0].mean_residual_us(), -10000, 500);
}

TEST(Where, AWeakBiasOfOneFingerIsSeenAlthoughTheExcessIsSmall) {
  MadeUpSet set(5, 48, 4, kSigmaS, 4);
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 1] += 0.3 * kSigmaS;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_EQ(slices[0].slice(), "finger = m");
}

TEST(Where, ATouchThatIsLeftOutCountsNowhere) {
  MadeUpSet set(5, 48, 4, kSigmaS, 5);
  for (int k = 0; k < set.size(); ++k)
    if (set.observations.object[k] == 2) {
      set.observations.time_s[k * 3] += 1;
      set.observations.used[k] = 0;
    }
  set.Finish();
  EXPECT_THAT(Slices(set), testing::IsEmpty());
}

TEST(Where, AFewTouchesAndMissingFingersAreNoTrouble) {
  for (const int poses : {1, 2, 5, 12}) {
    MadeUpSet set(1, poses, 4, kSigmaS, 6);
    for (int k = 0; k < set.size(); k += 3) set.observations.time_s[k * 3 + k % 2] = NAN;
    for (int i = 0; i < 3; ++i) set.observations.time_s[i] = NAN;
    set.Finish();
    EXPECT_THAT(Slices(set), testing::IsEmpty()) << poses;
  }
}

TEST(Where, CountsAllTouchesOfALargeSet) {
  MadeUpSet set(5, 500, 40, kSigmaS, 7);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i)
      if (set.IncidenceDeg(k, i) > 20) set.observations.time_s[k * 3 + i] -= 0.03;
  set.Finish();
  const auto slices = Slices(set);
  ASSERT_FALSE(slices.empty());
  EXPECT_GT(slices[0].touches(), 30000u);  // more than the search reads
}

TEST(TimeInWords, HasThreeFiguresAndAUnitThatFits) {
  EXPECT_EQ(TimeInWords(0.0091), "9.1 ms");
  EXPECT_EQ(TimeInWords(0.0412), "41.2 ms");
  EXPECT_EQ(TimeInWords(0.00041), "410 us");
  EXPECT_EQ(TimeInWords(1.25), "1.25 s");
  EXPECT_EQ(TimeInWords(-0.0091), "-9.1 ms");
}

}  // namespace
}  // namespace touchstone
