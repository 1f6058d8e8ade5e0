#include "server/touch/gauss_markov.h"

#include <gtest/gtest.h>

#include <cmath>

namespace touchstone::touch {
namespace {

TEST(GaussMarkov, HasUnitVarianceAndExponentialCorrelation) {
  double square = 0, near = 0, far = 0;
  constexpr int kSeeds = 4000;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    const double x = GaussMarkov(seed, 0, 40.3);
    square += x * x;
    near += x * GaussMarkov(seed, 0, 40.8);
    far += x * GaussMarkov(seed, 0, 42.3);
  }
  EXPECT_NEAR(square / kSeeds, 1, 0.08);
  EXPECT_NEAR(near / kSeeds, std::exp(-0.5), 0.08);
  EXPECT_NEAR(far / kSeeds, std::exp(-2), 0.08);
}

TEST(GaussMarkov, IsOnePathPerSeedAndFinger) {
  EXPECT_EQ(GaussMarkov(1, 0, 3.7), GaussMarkov(1, 0, 3.7));
  EXPECT_NE(GaussMarkov(1, 0, 3.7), GaussMarkov(1, 1, 3.7));
  EXPECT_NE(GaussMarkov(1, 0, 3.7), GaussMarkov(2, 0, 3.7));
  EXPECT_NEAR(GaussMarkov(1, 0, 3.7), GaussMarkov(1, 0, 3.7 + 1e-7), 1e-3);
}

TEST(GaussMarkov, ContinuesAcrossItsCells) {
  for (uint64_t seed = 0; seed < 20; ++seed)
    EXPECT_NEAR(GaussMarkov(seed, 0, 32 - 1e-9), GaussMarkov(seed, 0, 32 + 1e-9), 1e-4);
}

}  // namespace
}  // namespace touchstone::touch
