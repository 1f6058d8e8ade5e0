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
using ::testing::Lt;
using ::testing::Ne;
using ::testing::Not;

// Of a touch, without what is to be found, and where its noise comes from.
struct Touched {
  int row;
  const double* time_s;  // of three fingers
  RandomStream& random;
};

// 384 touches with a noise of 3 ms, each reading later by `late_s`, which is asked in the order of the file.
Ladder LadderOf(const std::function<double(const Touched& touch, int finger)>& late_s) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.sigma_us = 3000;
  DiagnosisInput input = touches::MakeTestInput(rig);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  RandomStream random(5, RandomDomain::kTest);
  for (int row = 0; row < set->size(); ++row) {
    const double* given_s = &input.set->time_s[static_cast<size_t>(row) * 3];
    for (int i = 0; i < 3; ++i)
      set->time_s[static_cast<size_t>(row) * 3 + i] += late_s({row, given_s, random}, i);
  }
  input.set = set;
  Selected selected = SelectFor(input);
  auto ladder = BuildLadder(*selected.workspace, &selected.result);
  EXPECT_TRUE(ladder.ok()) << ladder.status();
  return *std::move(ladder);
}

TEST(Ladder, ReadingsThatComeLateNowAndThenAreNoHeavyTails) {
  const Ladder ladder =
      LadderOf([](const Touched& touch, int) { return -0.012 * std::log(1 - touch.random.Uniform()); });
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  EXPECT_THAT(ladder.steps, Each(Field(&engine::LadderStep::effect, Ne("heavy_tail_noise"))));
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->words,
              HasSubstr("come late by an amount that is exponentially distributed"));
}

// Kind: what a misfit looks like is not said of the noise.
TEST(Ladder, AMisfitIsNotCalledLopsidedNoise) {
  const Ladder ladder = LadderOf([](const Touched& touch, int finger) {
    const double* time_s = touch.time_s;
    return finger == 0 && time_s[0] <= std::min(time_s[1], time_s[2]) ? 0.015 : 0;
  });
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->words, Not(HasSubstr("scatter farther")));
  EXPECT_FALSE(ladder.unexplained->covariates.empty());
}

// Kind: scatter is asked of what the curve leaves.
TEST(Ladder, AWaveInTimeIsNoPlayOfTheArm) {
  const Ladder ladder = LadderOf(
      [](const Touched& touch, int finger) { return finger == 2 ? 0.012 * std::sin(touch.row / 20.0) : 0; });
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->words, Not(HasSubstr("lay elsewhere at every touch")));
  EXPECT_EQ(ladder.unexplained->covariates[0].name, "session_time_s");
}

// Kind: means that look like scatter are no noise of a finger.
TEST(Ladder, EverySecondTouchThatIsLateIsNoNoiseOfAFinger) {
  const Ladder ladder = LadderOf(
      [](const Touched& touch, int finger) { return finger == 1 && touch.row % 2 == 1 ? 0.009 : 0; });
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  EXPECT_THAT(ladder.steps, Each(Field(&engine::LadderStep::effect, Ne("finger_noise"))));
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->words, HasSubstr("Touches take turns: finger m"));
}

// Kind: what has no name takes the place of an effect that looks like it.
TEST(Ladder, AClockOfOneFingerIsNoLength) {
  const Ladder ladder =
      LadderOf([](const Touched& touch, int finger) { return finger == 2 ? 0.0025 * touch.time_s[2] : 0; });
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  EXPECT_THAT(ladder.steps, Each(Field(&engine::LadderStep::probability, Lt(0.99))));
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->formula, HasSubstr("travel_mm"));
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
