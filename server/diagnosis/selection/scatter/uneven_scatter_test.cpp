#include "server/diagnosis/selection/scatter/uneven_scatter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/base/numbers/random.h"
#include "server/diagnosis/touches/noise/noise_sample.h"
#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

// Residuals of normal noise, times what `scale` says of each touch.
touches::SyntheticSet SetWith(const std::function<double(const touches::SyntheticSet&, int)>& scale,
                              uint64_t seed, int rounds = 4) {
  touches::SyntheticSet set(5, 24, rounds, touches::kSyntheticSigmaS, seed);
  for (int k = 0; k < set.observations.size(); ++k)
    for (int i = 0; i < 3; ++i) set.residuals[k * 3 + i] *= scale(set, k);
  return set;
}

std::optional<UnevenScatter> Found(const touches::SyntheticSet& set) {
  const touches::NoiseFindings noise =
      touches::FindNoise(touches::MakeNoiseSample(set.observations, set.residuals, set.prediction), 0);
  return FindUnevenScatter(set.observations, set.prediction,
                           touches::MakeNoiseSample(set.observations, set.residuals, set.prediction), noise);
}

TEST(UnevenScatter, OneObjectThatScattersMoreIsNamed) {
  const auto found =
      Found(SetWith([](const auto& set, int k) { return set.observations.object[k] == 2 ? 2.0 : 1.0; }, 1));
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->test.name, "object");
  EXPECT_FALSE(found->tails_remain)
      << "a mixture of two normal distributions looks heavy-tailed, each part does not";
  EXPECT_THAT(found->words, HasSubstr("object1 5.1 ms, object2 9.5 ms"));
}

TEST(UnevenScatter, ScatterThatGrowsThroughTheSessionIsNamed) {
  const auto found =
      Found(SetWith([](const auto& set, int k) { return 0.5 + 1.5 * k / set.observations.size(); }, 2));
  ASSERT_TRUE(found.has_value());
  // The set has as many rounds as a session has quarters.
  EXPECT_THAT(found->test.name, AnyOf("session_time_s", "round"));
  ASSERT_EQ(found->parts.size(), 4u);
  EXPECT_LT(found->parts[0].scale_s, found->parts[3].scale_s);
}

TEST(UnevenScatter, OneFingerThatScattersMoreFromSomeTimeOnIsNamed) {
  touches::SyntheticSet set(1, 60, 6, touches::kSyntheticSigmaS, 4);
  RandomStream random(4, RandomDomain::kTest);
  for (int k = 240; k < set.size(); ++k)
    set.observations.time_s[k * 3 + 2] += 3 * touches::kSyntheticSigmaS * random.Normal();
  set.Finish();
  const auto found = Found(set);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->finger, 2);
  EXPECT_THAT(found->words, HasSubstr("The times of finger r scatter by an amount that depends on"));
}

TEST(UnevenScatter, IsFoundWithoutRepeats) {
  const auto found = Found(
      SetWith([](const auto& set, int k) { return set.observations.object[k] == 2 ? 2.5 : 1.0; }, 3, 1));
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->test.name, "object");
}

TEST(UnevenScatter, IsNothingThatChanceBringsAbout) {
  int found = 0;
  for (uint64_t seed = 10; seed < 30; ++seed)
    found += Found(SetWith([](const auto&, int) { return 1.0; }, seed)).has_value();
  EXPECT_EQ(found, 0);
}

TEST(UnevenScatter, HeavyTailsAreNoDifferenceBetweenParts) {
  int found = 0;
  for (uint64_t seed = 10; seed < 14; ++seed) {
    RandomStream random(seed, RandomDomain::kTest);
    touches::SyntheticSet set = SetWith([](const auto&, int) { return 1.0; }, seed);
    // Student's t of 3 degrees of freedom, reading by reading.
    for (double& residual : set.residuals) {
      double squares = 0;
      for (int j = 0; j < 3; ++j) squares += std::pow(random.Normal(), 2);
      residual /= std::sqrt(squares / 3);
    }
    found += Found(set).has_value();
  }
  EXPECT_EQ(found, 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
