#include "server/diagnosis/engine/ladder/step_order.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kOrderNoiseS = 0.005;
constexpr double kOrderColumn = 50;  // per m
constexpr double kOrderHiddenM = 0.8e-3;
constexpr Quality kAsGiven = {10, 10, 0};

// An explanation of three steps: by themselves gravity_sag explains most, object_push least.
class StepOrderTest : public ::testing::Test {
 protected:
  StepOrderTest() : rows(4, 25, 2) {
    rows.measured = rows.Random(9, kOrderNoiseS);
    model::Model model = model::NominalModel();
    Parameterization start(model, rows.groups());
    double size = kOrderHiddenM;
    for (const char* effect : {"object_push", "oblique_slip", "gravity_sag"}) {
      rows.columns[effect] = rows.Random(rows.columns.size() + 1, kOrderColumn);
      rows.measured += size * rows.columns[effect];
      size += kOrderHiddenM;
      start.Add(effects::Catalogue().Find(effect), false);
      SelectedStep& step = steps.emplace_back();
      step.effect = static_cast<int>(steps.size()) - 1;
      step.probability = 0.9;
    }
    likelihood = std::make_unique<Likelihood>(rows.GroupRows(), nullptr, 0, nullptr);
    experiment.observations = &rows;
    experiment.likelihood = likelihood.get();
    whole = {*FitModel(experiment, start), 0};
  }

  // "gsp": gravity_sag, then oblique_slip, then object_push. `errors`: by the steps so far, in the order of the alphabet.
  static char Letter(const std::string& effect) {
    return effect == "gravity_sag" ? 'g' : effect == "oblique_slip" ? 's' : 'p';
  }
  StepOrder Order(const std::map<std::string, double>& errors) {
    return *OrderSteps(experiment, whole, -1, steps, kAsGiven, [&](const OrderedStep& step, const Quality&) {
      std::string letters;
      for (const model::EffectInstance& instance : step.fit.model.base().effects)
        letters += Letter(instance.effect->name);
      std::sort(letters.begin(), letters.end());
      const double error = errors.at(letters);
      return absl::StatusOr<Quality>(Quality{error, error, 0});
    });
  }
  std::string Letters(const StepOrder& order) const {
    std::string letters;
    for (const OrderedStep& step : order.steps)
      letters += Letter(whole.fit.model.base().effects[step.step->effect].effect->name);
    return letters;
  }

  LinearTestModel rows;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
  std::vector<SelectedStep> steps;
  Explanation whole;
};

TEST_F(StepOrderTest, WhatExplainsMostComesFirst) {
  const StepOrder order = Order({{"g", 7}, {"gs", 6}, {"gps", 5}});
  EXPECT_EQ(Letters(order), "gsp");
  EXPECT_EQ(order.without_gain, -1);
  EXPECT_EQ(order.steps[0].fit.model.size(), 1);
  EXPECT_EQ(order.steps[1].quality.rmse, 6);
  EXPECT_FALSE(order.steps[1].whole);
  EXPECT_TRUE(order.steps[2].whole);
}

TEST_F(StepOrderTest, StepThatNeedsAWeakerOneComesAfterIt) {
  const StepOrder order = Order({{"g", 7}, {"gs", 8}, {"gp", 6}, {"gps", 5}});
  EXPECT_EQ(Letters(order), "gps");
  EXPECT_EQ(order.without_gain, -1);
}

// Of two steps that need each other, one has gain before the step that took its place.
TEST_F(StepOrderTest, TwoStepsThatNeedEachOtherAreBothKept) {
  const StepOrder order =
      Order({{"g", 7}, {"gs", 9.5}, {"gp", 7}, {"s", 9}, {"ps", 8}, {"p", 11}, {"gps", 5}});
  EXPECT_EQ(Letters(order), "spg");
}

TEST_F(StepOrderTest, StepWithoutGainAfterAllOthersIsTakenOut) {
  const StepOrder order =
      Order({{"g", 7}, {"s", 9}, {"p", 9}, {"gs", 7.5}, {"gp", 6}, {"ps", 10}, {"gps", 6.2}});
  EXPECT_TRUE(order.steps.empty());
  EXPECT_EQ(order.without_gain, steps[1].effect);  // oblique_slip, although it explains more than object_push
}

TEST_F(StepOrderTest, WhereEachHasGainAfterTheOthersTheWeakestIsTakenOut) {
  const StepOrder order =
      Order({{"g", 11}, {"s", 11}, {"p", 11}, {"gs", 9}, {"gp", 9}, {"ps", 9}, {"gps", 5}});
  EXPECT_EQ(order.without_gain, steps[0].effect);
}

TEST_F(StepOrderTest, LowerErrorOfTheFitAloneIsNoGain) {
  EXPECT_TRUE(Falls(kAsGiven, {9, 9, 0}, steps[0]));
  EXPECT_FALSE(Falls(kAsGiven, {9, 10, 0}, steps[0]));
  EXPECT_FALSE(Falls(kAsGiven, {10, 9, 0}, steps[0]));
}

TEST_F(StepOrderTest, AnImprobableStepNeedsTheGainThatASearchAsksFor) {
  EXPECT_TRUE(Falls(kAsGiven, {9.98, 9.98, 0}, steps[0]));
  steps[0].probability = 0.13;
  EXPECT_FALSE(Falls(kAsGiven, {9.98, 9.98, 0}, steps[0]));
  EXPECT_TRUE(Falls(kAsGiven, {9.9, 9.9, 0}, steps[0]));
  EXPECT_TRUE(Falls(kAsGiven, {9.98, 9.98, 0}, SelectedStep()));  // of photographs: not assessed by then
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
