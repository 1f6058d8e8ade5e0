#include "server/diagnosis/selection/ladder/ladder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/numbers/random.h"
#include "server/diagnosis/selection/curves/curve_effect.h"
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

// Beside a length of the finger the curve was another; the length left, and the curve stayed as it was.
TEST(Ladder, ACurveIsFittedAnewWhereAnEffectBesideItLeaves) {
  touches::HiddenRig rig;
  rig.objects = {"lat10"};
  rig.samples_per_face = 10;
  rig.rounds = 3;
  rig.sigma_us = 5000;
  rig.speeds_mm_s = {10, 20, 40};
  rig.hidden = {{"formula",
                 {"name=release", "adds=time_us", "expression=k*(finger==-1)*(speed_mm_s/20)^2", "k=8000",
                  "k_unit=us", "k_min=-100000", "k_max=100000"}}};
  Selected selected = SelectFor(touches::MakeTestInput(rig));
  const auto ladder = BuildLadder(*selected.workspace, &selected.result);
  ASSERT_TRUE(ladder.ok()) << ladder.status();
  ASSERT_TRUE(ladder->unexplained && ladder->unexplained->model_with);
  EXPECT_FALSE(ladder->unexplained->lookup_yaml.empty());
  EXPECT_LT(ladder->unexplained->rmse, 0.6 * ladder->final.rmse);
  EXPECT_NEAR(ladder->unexplained->rmse,
              *ErrorAsCompared(*selected.workspace, *ladder->unexplained->model_with), 1e-9);
}

// A curve that raises the error is no suggestion; the simple term of its covariate takes its place.
TEST(Ladder, ACurveThatRaisesTheErrorGivesWayToTheNearestFormula) {
  touches::HiddenRig rig;
  rig.samples_per_face = 6;
  rig.hidden = {{"lookup",
                 {"name=wave", "adds=travel_mm", "covariate=approach_z", "knots=-1,-0.3,0,0.5,1",
                  "l=0,0.5,-0.4,0.5,0", "m=0,0,0,0,0", "r=0,0,0,0,0"}}};
  Selected selected = SelectFor(touches::MakeTestInput(rig));
  ASSERT_TRUE(selected.result.curve);
  const int at = selected.result.formula;
  ASSERT_GE(at, 0);
  NamelessCurve wrong = *selected.result.curve;
  for (std::vector<double>& values : wrong.values)
    for (double& value : values) value *= -3;
  engine::Parameterization start = selected.result.without_formula.model;
  start.Add(*MakeCurveEffect(wrong), false);
  selected.result.fit = *engine::FitModel(selected.workspace->experiment, std::move(start));
  selected.result.curve = wrong;
  const auto ladder = BuildLadder(*selected.workspace, &selected.result);
  ASSERT_TRUE(ladder.ok()) << ladder.status();
  EXPECT_EQ(ladder->verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(ladder->unexplained.has_value());
  EXPECT_TRUE(ladder->unexplained->lookup_yaml.empty()) << ladder->unexplained->lookup_yaml;
  if (ladder->unexplained->model_with) {
    EXPECT_FALSE(ladder->unexplained->formula.empty());
    EXPECT_LT(ladder->unexplained->rmse, ladder->final.rmse);
  }
  EXPECT_FALSE(ladder->unexplained->covariates.empty());
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
