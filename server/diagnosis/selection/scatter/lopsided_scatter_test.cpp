#include "server/diagnosis/selection/scatter/lopsided_scatter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::HasSubstr;

// 480 touches of three fingers whose readings are drawn one by one.
std::optional<LopsidedScatter> Found(uint64_t seed,
                                     const std::function<double(RandomStream&, int)>& reading_s) {
  RandomStream random(seed, RandomDomain::kTest);
  std::vector<touches::ReadingGroup> groups(480);
  for (touches::ReadingGroup& group : groups)
    for (int i = 0; i < 3; ++i) {
      group.residual_s.push_back(reading_s(random, i));
      group.growth.push_back(0);
      group.channel.push_back(i);
    }
  return FindLopsidedScatter(groups, 3);
}

double Exponential(RandomStream& random) {
  return -std::log(1 - random.Uniform());
}

TEST(LopsidedScatter, DelaysThatComeNowAndThenAreSeen) {
  const auto found = Found(
      1, [](RandomStream& random, int) { return 0.004 * random.Normal() + 0.010 * Exponential(random); });
  ASSERT_TRUE(found.has_value());
  EXPECT_GT(found->late_s, 1.1 * found->early_s);
  EXPECT_THAT(found->words, HasSubstr("farther to the late side"));
}

TEST(LopsidedScatter, OneFingerIsEnough) {
  const auto found = Found(2, [](RandomStream& random, int finger) {
    return 0.004 * random.Normal() - (finger == 1 ? 0.015 * Exponential(random) : 0);
  });
  ASSERT_TRUE(found.has_value());
  EXPECT_THAT(found->words, HasSubstr("The times of finger m scatter farther to the early side"));
}

TEST(LopsidedScatter, SymmetricNoiseIsNot) {
  for (uint64_t seed = 10; seed < 60; ++seed) {
    EXPECT_FALSE(Found(seed, [](RandomStream& random, int) { return 0.005 * random.Normal(); })) << seed;
    // Student's t of two degrees of freedom, of another size for each finger.
    EXPECT_FALSE(Found(seed, [](RandomStream& random, int finger) {
      return 0.003 * (1 + finger) * random.Normal() / std::sqrt(Exponential(random));
    })) << seed;
  }
}

TEST(LopsidedScatter, TwoFingersSayNothing) {
  std::vector<touches::ReadingGroup> groups(500);
  RandomStream random(3, RandomDomain::kTest);
  for (touches::ReadingGroup& group : groups) {
    group.residual_s = {Exponential(random), 0};
    group.growth = {0, 0};
    group.channel = {0, 1};
  }
  EXPECT_FALSE(FindLopsidedScatter(groups, 2).has_value());
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
