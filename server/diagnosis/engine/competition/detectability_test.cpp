#include "server/diagnosis/engine/competition/detectability.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/test_tier.h"
#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kDetectSigma = 0.005;
constexpr double kDetectColumn = 50;  // per m
constexpr double kMm = 1e-3;

// Rows that two effects move, and a third that resembles the first.
class DetectabilityTest : public ::testing::Test {
 protected:
  DetectabilityTest() : rows(4, 50, 2) {
    for (const char* effect : {"object_push", "tip_radius"}) {
      rows.columns[effect] = rows.Random(rows.columns.size() + 1, kDetectColumn);
      candidates.push_back({effects::Catalogue().Find(effect), false, false, {}});
    }
  }
  void AddRival(double share) {
    rows.columns["oblique_slip"] =
        share * rows.columns["object_push"] + std::sqrt(1 - share * share) * rows.Random(30, kDetectColumn);
    candidates.push_back({effects::Catalogue().Find("oblique_slip"), false, false, {}});
  }
  std::vector<DetectableValue> Detectable() {
    likelihood = std::make_unique<Likelihood>(rows.GroupRows(), nullptr, 0, nullptr);
    experiment = {};
    experiment.observations = &rows;
    experiment.likelihood = likelihood.get();
    const Fit given = *FitModel(experiment, {model::NominalModel(), rows.groups()}, 0);
    const StepwiseSearch search(experiment, candidates, SearchRules(), [](const std::string&) {});
    return *FindDetectable(search, given, 0, kDetectSigma);
  }
  // In how many of `sets` sets of rows a search adds object_push of this size, in mm.
  int Found(double size_mm, int sets) {
    int found = 0;
    for (int set = 0; set < sets; ++set) {
      rows.measured = size_mm * kMm * rows.columns["object_push"] + rows.Random(100 + set, kDetectSigma);
      const StepwiseSearch search(experiment, candidates, SearchRules(), [](const std::string&) {});
      const Explanation explanation = *search.Run({model::NominalModel(), rows.groups()}, 0);
      for (const model::EffectInstance& instance : explanation.fit.model.base().effects)
        found += instance.effect->name == "object_push";
    }
    return found;
  }
  LinearTestModel rows;
  std::vector<Candidate> candidates;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
};

TEST_F(DetectabilityTest, TheStandardErrorIsThatOfLeastSquares) {
  const DetectableValue push = Detectable()[0];
  ASSERT_EQ(push.effect->name, "object_push");
  EXPECT_NEAR(push.std_error, kDetectSigma / rows.columns["object_push"].norm() / kMm, 0.01 * push.std_error);
}

TEST_F(DetectabilityTest, ASearchFindsTheNamedSizeInFourOfFiveSets) {
  const DetectableValue push = Detectable()[0];
  ASSERT_TRUE(push.found_from.has_value());
  // 0.8 of 200: 5 standard deviations are 28.
  EXPECT_NEAR(Found(*push.found_from, 200), 160, 28);
  EXPECT_LT(Found(0.5 * *push.found_from, 50), 15);
  EXPECT_EQ(Found(2 * *push.found_from, 50), 50);
}

TEST_F(DetectabilityTest, TwiceTheNoiseTakesTwiceTheSize) {
  const DetectableValue push = Detectable()[0];
  const Fit given = *FitModel(experiment, {model::NominalModel(), rows.groups()}, 0);
  const StepwiseSearch search(experiment, candidates, SearchRules(), [](const std::string&) {});
  const DetectableValue noisy = (*FindDetectable(search, given, 0, 2 * kDetectSigma))[0];
  EXPECT_NEAR(*noisy.found_from / *push.found_from, 2, 0.05);
}

TEST_F(DetectabilityTest, AnEffectThatMovesNoRowIsNotFound) {
  rows.columns["object_push"].setZero();
  const DetectableValue push = Detectable()[0];
  EXPECT_EQ(push.std_error, 0);
  EXPECT_EQ(push.power_at_typical, 0);
  EXPECT_FALSE(push.found_from.has_value());
}

// The slope where it changes nothing says nothing of larger sizes.
TEST_F(DetectabilityTest, AnEffectThatShowsOnlyFromASizeOnIsFoundFromThere) {
  const double without = *Detectable()[0].found_from;
  const double typical = Detectable()[0].typical;
  rows.dead = 1.3 * typical * kMm;
  const DetectableValue push = Detectable()[0];
  EXPECT_EQ(push.power_at_typical, 0);
  ASSERT_TRUE(push.found_from.has_value());
  EXPECT_NEAR(*push.found_from, 1.3 * typical + without, 0.1 * typical);
}

// A column of zeros made the correlation a NaN, and what moves no row the nearest rival.
TEST_F(DetectabilityTest, WhatMovesNoRowIsNoRival) {
  AddRival(0.5);
  rows.columns["tip_radius"].setZero();
  EXPECT_EQ(Detectable()[0].rival, "oblique_slip");
}

TEST_F(DetectabilityTest, NoSizeBeyondTwentyTimesWhatRigsShowIsNamed) {
  rows.columns["object_push"] *= 1e-4;
  const DetectableValue push = Detectable()[0];
  EXPECT_GT(push.std_error, 0);
  EXPECT_FALSE(push.found_from.has_value());
}

TEST_F(DetectabilityTest, ARivalTakesALargerSizeToBeToldFrom) {
  AddRival(0.98);
  const DetectableValue push = Detectable()[0];
  EXPECT_EQ(push.rival, "oblique_slip");
  EXPECT_NEAR(push.correlation, 0.98, 0.01);
  ASSERT_TRUE(push.told_from.has_value());
  EXPECT_GT(*push.told_from, 1.5 * *push.found_from);
}

TEST_F(DetectabilityTest, WhatMovesTheRowsAlikeIsNeverToldApart) {
  AddRival(1);
  const DetectableValue push = Detectable()[0];
  EXPECT_EQ(push.rival, "oblique_slip");
  EXPECT_NEAR(push.correlation, 1, 1e-6);
  EXPECT_TRUE(push.found_from.has_value());
  EXPECT_FALSE(push.told_from.has_value());
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
