#include "server/diagnosis/distributions/assumed_plan.h"

#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/diagnosis/distributions/pose_free_rank.h"
#include "server/diagnosis/distributions/pose_free_test_set.h"

namespace touchstone::diagnosis::distributions {
namespace {

TEST(SequentialP, IsExactWhetherOneStopsOrNot) {
  EXPECT_EQ(SequentialP({1, 2, 3, 4}, 5, 2), 1 / 5.0);
  EXPECT_EQ(SequentialP({1, 2, 3, 4}, 4, 2), 2 / 5.0);
  EXPECT_EQ(SequentialP({1, 2, 3, 4}, 3, 2), 2 / 4.0);
  EXPECT_EQ(SequentialP({4, 4, 1, 1}, 3, 2), 1);  // what is made after the second does not count
}

TEST(CountRepeats, SeesRoundsRepeatsInAnyOrderAndNone) {
  bool in_rounds = false;
  const auto model = WedgeModel(kWedgeNoise);
  DiagnosisInput input = MakePoseFreeInput(model, 8, 4, 1);
  EXPECT_EQ(CountRepeats(input.set->time_s, 3, &in_rounds), 4);
  EXPECT_TRUE(in_rounds);
  // Shuffled.
  std::vector<double> shuffled = input.set->time_s;
  RandomStream random(1, RandomDomain::kTest);
  for (int n = 191; n > 0; --n) {
    const int other = static_cast<int>(random.Below(n + 1));
    for (int i = 0; i < 3; ++i) std::swap(shuffled[n * 3 + i], shuffled[other * 3 + i]);
  }
  EXPECT_EQ(CountRepeats(shuffled, 3, &in_rounds), 4);
  EXPECT_FALSE(in_rounds);
  input = MakePoseFreeInput(model, 32, 1, 2);
  EXPECT_EQ(CountRepeats(input.set->time_s, 3, &in_rounds), 1);
  EXPECT_FALSE(in_rounds);
}

}  // namespace
}  // namespace touchstone::diagnosis::distributions
