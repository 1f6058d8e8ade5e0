#include "server/diagnosis/residuals/touches/finger_scatter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

// Noise of another size on finger m.
touches::SyntheticSet WithNoiseOfTheMiddleFinger(double sigma_s, uint64_t seed) {
  touches::SyntheticSet set(5, 48, 4, 0, seed);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i)
      set.observations.time_s[k * 3 + i] += (i == 1 ? sigma_s : touches::kSyntheticSigmaS) *
                                            RandomStream(seed, RandomDomain::kTest, k * 3 + i, 9).Normal();
  set.Finish();
  return set;
}

TEST(FingerScatter, FindsTheFingerThatIsQuieter) {
  const auto set = WithNoiseOfTheMiddleFinger(0.4 * touches::kSyntheticSigmaS, 1);
  const auto found = FindFingerScatter(set.observations, set.residuals);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->finger, 1);
  EXPECT_LT(found->rmse_s, 0.8 * found->others_rmse_s);
  EXPECT_LT(found->p_value, 1e-6);
}

TEST(FingerScatter, FindsNoneInOneNoiseForAll) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const touches::SyntheticSet set(3, 48, 4, touches::kSyntheticSigmaS, 100 + seed);
    EXPECT_FALSE(FindFingerScatter(set.observations, set.residuals)) << seed;
  }
}

// Kind: what a test takes for independent that is not.
TEST(FingerScatter, FindsNoneInCorrelatedNoiseOfAllFingers) {
  int found = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    touches::SyntheticSet set(3, 48, 4, 0.3 * touches::kSyntheticSigmaS, 200 + seed);
    RandomStream random(seed, RandomDomain::kTest);
    const double rho = std::exp(-1.0 / 30);  // of a memory of thirty touches
    for (int i = 0; i < 3; ++i) {
      double state = random.Normal();
      for (int k = 0; k < set.size(); ++k) {
        state = rho * state + std::sqrt(1 - rho * rho) * random.Normal();
        set.observations.time_s[k * 3 + i] += touches::kSyntheticSigmaS * state;
      }
    }
    set.Finish();
    found += FindFingerScatter(set.observations, set.residuals).has_value();
  }
  EXPECT_LE(found, 1);
}

TEST(FingerScatter, IsNotFooledByFewWildTouches) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 3);
  set.observations.time_s[77 * 3 + 1] += 0.5;
  set.Finish();
  EXPECT_FALSE(FindFingerScatter(set.observations, set.residuals));
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
