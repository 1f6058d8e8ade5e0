#include "server/diagnosis/selection/ladder/ladder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/numbers/random.h"
#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::Each;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::Ne;
using ::testing::Not;

// 384 touches with a noise of 3 ms, each reading later by `late_s`, which is asked in the order of the file.
Ladder LadderOf(const std::function<double(const double* time_s, int finger, RandomStream& random)>& late_s) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.sigma_us = 3000;
  DiagnosisInput input = touches::MakeTestInput(rig);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  RandomStream random(5, RandomDomain::kTest);
  for (int row = 0; row < set->size(); ++row) {
    const double* given_s = &input.set->time_s[static_cast<size_t>(row) * 3];
    for (int i = 0; i < 3; ++i) set->time_s[static_cast<size_t>(row) * 3 + i] += late_s(given_s, i, random);
  }
  input.set = set;
  Selected selected = SelectFor(input);
  auto ladder = BuildLadder(*selected.workspace, &selected.result);
  EXPECT_TRUE(ladder.ok()) << ladder.status();
  return *std::move(ladder);
}

TEST(Ladder, ReadingsThatComeLateNowAndThenAreNoHeavyTails) {
  const Ladder ladder = LadderOf(
      [](const double*, int, RandomStream& random) { return -0.012 * std::log(1 - random.Uniform()); });
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  EXPECT_THAT(ladder.steps, Each(Field(&engine::LadderStep::effect, Ne("heavy_tail_noise"))));
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->words,
              HasSubstr("come late by an amount that is exponentially distributed"));
}

// Kind: what a misfit looks like is not said of the noise.
TEST(Ladder, AMisfitIsNotCalledLopsidedNoise) {
  const Ladder ladder = LadderOf([](const double* time_s, int finger, RandomStream&) {
    return finger == 0 && time_s[0] <= std::min(time_s[1], time_s[2]) ? 0.015 : 0;
  });
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->words, Not(HasSubstr("scatter farther")));
  EXPECT_FALSE(ladder.unexplained->covariates.empty());
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
