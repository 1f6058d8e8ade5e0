#include "server/diagnosis/selection/ladder/hypotheses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::diagnosis::selection {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<std::string> Names(const engine::UnexplainedRest& rest) {
  std::vector<std::string> names;
  for (const engine::CovariateTest& test : rest.covariates) names.push_back(test.name);
  return names;
}

Hypotheses::NameFirst InFront(const std::string& name) {
  return [name](engine::UnexplainedRest* rest) {
    rest->covariates.insert(rest->covariates.begin(), {name, 0, 0});
  };
}

TEST(Hypotheses, RulesStandInTheOrderOfTheEnumeration) {
  for (size_t i = 0; i < HypothesisRules().size(); ++i)
    EXPECT_EQ(static_cast<size_t>(HypothesisRules()[i].hypothesis), i) << HypothesisRules()[i].name;
  EXPECT_EQ(static_cast<size_t>(Hypothesis::kMisfit) + 1, HypothesisRules().size());
}

TEST(Hypotheses, NothingFoundLeavesNothingAndAllowsEveryQuestion) {
  const Hypotheses none;
  EXPECT_FALSE(none.Leave(Leaves::kScatter));
  EXPECT_TRUE(none.Allows(Question::kNoise));
  EXPECT_THAT(none.Words(), IsEmpty());
}

TEST(Hypotheses, CorrelatedNoiseIsExplainedAndARandomWalkIsNot) {
  Hypotheses correlated, walk;
  correlated.Add(Hypothesis::kCorrelatedNoise);
  walk.Add(Hypothesis::kRandomWalk, "The fingers drift.");
  EXPECT_FALSE(correlated.Leave(Leaves::kScatter));
  EXPECT_TRUE(walk.Leave(Leaves::kMeans));
  for (const Hypotheses& memory : {correlated, walk}) {
    EXPECT_FALSE(memory.Allows(Question::kMisfit));
    EXPECT_TRUE(memory.Allows(Question::kNoise));
  }
}

TEST(Hypotheses, AnObjectThatMovesExcludesNoiseOfTheFingers) {
  for (const Hypothesis moves : {Hypothesis::kRemounted, Hypothesis::kPlay, Hypothesis::kPartialOffset}) {
    Hypotheses found;
    found.Add(moves);
    EXPECT_FALSE(found.Allows(Question::kNoise));
    EXPECT_FALSE(found.Allows(Question::kUnevenScatter));
  }
}

TEST(Hypotheses, AnUnevenScatterSaysNothingAgainstTheMeans) {
  Hypotheses found;
  found.Add(Hypothesis::kUnevenScatter, "The scatter differs.");
  EXPECT_TRUE(found.Leave(Leaves::kScatter));
  EXPECT_FALSE(found.Leave(Leaves::kMeans));
}

TEST(Hypotheses, OnlyValuesAndRoundsSpeakAgainstTheSteps) {
  for (const HypothesisRule& rule : HypothesisRules()) {
    Hypotheses found;
    found.Add(rule.hypothesis);
    EXPECT_EQ(found.Leave(Leaves::kDoubts),
              rule.hypothesis == Hypothesis::kRemounted || rule.hypothesis == Hypothesis::kStrangeValues)
        << rule.name;
  }
}

TEST(Hypotheses, TheFirstOfSeveralIsSaidWhateverTheOrderOfFinding) {
  Hypotheses found;
  found.Add(Hypothesis::kMisfit);
  found.Add(Hypothesis::kTicks, "Ticks.");
  found.Add(Hypothesis::kRemounted, "Elsewhere in every round.");
  found.Add(Hypothesis::kStrangeValues, "At bounds.");
  EXPECT_EQ(found.Words(), "Elsewhere in every round.");
  found.Add(Hypothesis::kGroup, "Round 2 differs.");
  EXPECT_EQ(found.Words(), "Round 2 differs.");
}

TEST(Hypotheses, TheWordsOfACurveAreFollowedByThoseOfTheNext) {
  Hypotheses found;
  found.Add(Hypothesis::kTicks, "Ticks.");
  found.Add(Hypothesis::kCurve, "From touch 480 on.");
  found.Add(Hypothesis::kStrangeValues, "At bounds.");
  EXPECT_EQ(found.Words(), "From touch 480 on. At bounds.");
}

TEST(Hypotheses, TheCovariateThatWasFoundLastStandsInFront) {
  Hypotheses found;
  found.Add(Hypothesis::kCourse, "", InFront("session_time_s"));
  found.Add(Hypothesis::kRemounted, "Elsewhere.", InFront("round"));
  engine::UnexplainedRest rest;
  rest.covariates = {{"incidence_deg", 0, 0}};
  found.NameCovariates(&rest);
  EXPECT_THAT(Names(rest), ElementsAre("round", "session_time_s", "incidence_deg"));
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
