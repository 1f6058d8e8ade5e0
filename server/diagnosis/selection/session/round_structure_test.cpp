#include "server/diagnosis/selection/session/round_structure.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kNoiseS = touches::kSyntheticSigmaS;

TEST(RoundStructure, IsCalibratedUnderNoise) {
  int below = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const touches::SyntheticSet set = touches::TiltedSet(seed);
    const RoundStructure found = FindRoundStructure(set.observations, set.prediction, set.residuals);
    below += found.p < 0.1;
    EXPECT_FALSE(SharesRounds(found, kNoiseS)) << seed;
    EXPECT_NEAR(found.sigma_s, kNoiseS, 4e-4);
  }
  EXPECT_GE(below, 1);
  EXPECT_LE(below, 10);  // 4 are expected
}

TEST(RoundStructure, SeesObjectsThatWerePutDownAnewAndHowFar) {
  touches::SyntheticSet set = touches::TiltedSet(50);
  RandomStream random(2, RandomDomain::kTest);
  std::vector<Eigen::Vector3d> moved_m(5 * 4);
  for (Eigen::Vector3d& move_m : moved_m)
    move_m = Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()) * 0.3e-3;
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i) {
      set.observations.time_s[k * 3 + i] += touches::LaterBy(
          set, k, i, moved_m[set.observations.object[k] * 4 + set.observations.set->round[k]]);
    }
  set.Finish();
  const RoundStructure found = FindRoundStructure(set.observations, set.prediction, set.residuals);
  EXPECT_TRUE(SharesRounds(found, 0.0087));
  EXPECT_NEAR(found.sigma_s, kNoiseS, 4e-4);
  EXPECT_NEAR(found.translation_m, 0.3e-3 * std::sqrt(0.75), 0.1e-3);  // about the mean of four rounds
}

// Few poses with most of the noise, whose contacts stand rotated: the F test alone finds rounds in such sets.
TEST(RoundStructure, IsNoNoiseThatIsLargerAtSomePoses) {
  for (uint64_t seed = 60; seed < 80; ++seed) {
    touches::SyntheticSet set = touches::TiltedSet(seed);
    RandomStream random(seed, RandomDomain::kTest);
    for (int k = 0; k < set.size(); ++k)
      for (int i = 0; i < 3; ++i) {
        const double cosine = set.prediction.cos_incidence[k * 3 + i];
        const double slope = std::sqrt(1 / (cosine * cosine) - 1);
        set.observations.time_s[k * 3 + i] += 12 * kNoiseS * slope * slope * random.Normal();
      }
    set.Finish();
    const RoundStructure found = FindRoundStructure(set.observations, set.prediction, set.residuals);
    EXPECT_FALSE(SharesRounds(found, 100 * kNoiseS)) << seed << " p " << found.p;
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
