#include "server/diagnosis/selection/session/partial_offset.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::selection {
namespace {

// 240 poses touched 4 times: noise of 5 ms, and on each finger what `added` says.
template <typename Added>
std::optional<PartialOffset> OffsetOf(uint64_t seed, Added added) {
  touches::Observations o;
  std::vector<double> residuals;
  o.fingers = 3, o.poses = 240;
  RandomStream random(seed, RandomDomain::kTest);
  for (int k = 0; k < 960; ++k) {
    o.row.push_back(k), o.used.push_back(1), o.pose.push_back(k % 240);
    double r[3], mean = 0;
    const double chance = random.Uniform(0, 1);
    for (int i = 0; i < 3; ++i) r[i] = 0.005 * random.Normal() + added(k, i, chance), mean += r[i] / 3;
    for (const double value : r) residuals.push_back(value - mean);
  }
  return FindPartialOffset(o, residuals);
}

TEST(PartialOffset, IsFoundWithItsShareAndItsFinger) {
  const auto found =
      OffsetOf(1, [](int, int i, double chance) { return i == 2 && chance < 0.3 ? -0.02 : 0; });
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->share, 0.3, 0.05);
  EXPECT_NEAR(found->offset_s[2] - found->offset_s[0], -0.02, 0.001);
  EXPECT_NE(found->words.find("% of the touches finger r reports 2"), std::string::npos) << found->words;
  EXPECT_NE(found->words.find("earlier"), std::string::npos) << found->words;
}

TEST(PartialOffset, IsNotFoundInNoiseOfOneKind) {
  for (uint64_t seed = 1; seed <= 5; ++seed)
    EXPECT_FALSE(OffsetOf(seed, [](int, int, double) { return 0.0; }));
  // Long tails to both sides.
  EXPECT_FALSE(OffsetOf(6, [](int k, int i, double chance) {
    return i == k % 3 && chance < 0.05 ? 0.04 * (k % 2 ? 1 : -1) : 0;
  }));
}

TEST(PartialOffset, IsNotFoundWhereTimeOrPoseSaysWhich) {
  EXPECT_FALSE(OffsetOf(7, [](int k, int i, double) { return i == 0 && k > 600 ? 0.02 : 0; }));
  EXPECT_FALSE(OffsetOf(8, [](int k, int i, double) { return i == 0 && k % 240 % 3 == 0 ? 0.02 : 0; }));
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
