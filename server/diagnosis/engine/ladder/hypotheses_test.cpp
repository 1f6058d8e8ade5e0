#include "server/diagnosis/engine/ladder/hypotheses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/engine/ladder/ladder.h"

namespace touchstone::diagnosis::engine {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

enum { kDrift, kStain, kNoiseOfPart, kAnything };

const std::vector<HypothesisRule>& FourRules() {
  static const auto& rules = *new std::vector<HypothesisRule>{
      {kDrift, "drift", Leaves::kMeans, {kAnything}, 3},
      {kStain, "stain", Leaves::kDoubts, {kNoiseOfPart}, 1, true},
      {kNoiseOfPart, "noise of a part", Leaves::kBeside, {}, 2},
      {kAnything, "anything", Leaves::kMeans, {}},
  };
  return rules;
}

std::vector<std::string> Names(const UnexplainedRest& rest) {
  std::vector<std::string> names;
  for (const CovariateTest& test : rest.covariates) names.push_back(test.name);
  return names;
}

Hypotheses::Describe InFront(const std::string& name) {
  return [name](UnexplainedRest* rest) { PutFirst({name, 0, 0}, rest); };
}

// Which of four are asked where these are found when they are asked.
std::vector<int> Asked(const std::vector<int>& true_ones) {
  Hypotheses found(FourRules());
  std::vector<int> asked;
  Hypotheses::Questions questions;
  for (const int hypothesis : {kAnything, kStain, kNoiseOfPart, kDrift})
    questions[hypothesis] = [&found, &asked, &true_ones, hypothesis] {
      asked.push_back(hypothesis);
      if (std::find(true_ones.begin(), true_ones.end(), hypothesis) != true_ones.end()) found.Add(hypothesis);
      return absl::OkStatus();
    };
  EXPECT_TRUE(found.Ask(questions).ok());
  return asked;
}

TEST(Hypotheses, AreAskedInTheOrderOfTheTable) {
  EXPECT_THAT(Asked({}), ElementsAre(kDrift, kStain, kNoiseOfPart, kAnything));
}

TEST(Hypotheses, WhatIsExcludedByWhatWasFoundIsNotAsked) {
  EXPECT_THAT(Asked({kDrift}), ElementsAre(kDrift, kStain, kNoiseOfPart));
  EXPECT_THAT(Asked({kStain}), ElementsAre(kDrift, kStain, kAnything));
  EXPECT_THAT(Asked({kDrift, kStain}), ElementsAre(kDrift, kStain));
  EXPECT_THAT(Asked({kNoiseOfPart, kAnything}), ElementsAre(kDrift, kStain, kNoiseOfPart, kAnything));
}

TEST(Hypotheses, AQuestionThatFailsEndsTheWalk) {
  const Hypotheses found(FourRules());
  int asked = 0;
  const absl::Status status = found.Ask({{kDrift, [] { return absl::CancelledError("enough"); }},
                                         {kStain, [&] { return ++asked, absl::OkStatus(); }}});
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(asked, 0);
}

TEST(Hypotheses, NothingFoundLeavesNothingAndAllowsEverything) {
  const Hypotheses none(FourRules());
  EXPECT_FALSE(none.Leave(Leaves::kBeside));
  EXPECT_TRUE(none.Allows(kAnything));
  EXPECT_THAT(none.Words(), IsEmpty());
}

TEST(Hypotheses, TheFirstOfSeveralIsSaidWhateverTheOrderOfFinding) {
  Hypotheses found(FourRules());
  found.Add(kAnything);
  found.Add(kDrift, "Drifts.");
  EXPECT_EQ(found.Words(), "Drifts.");
  found.Add(kNoiseOfPart, "Noisier at night.");
  EXPECT_EQ(found.Words(), "Noisier at night.");
  found.Add(kStain, "Dirt.");
  EXPECT_EQ(found.Words(), "Dirt. Noisier at night.");
}

TEST(Hypotheses, TheCovariateThatWasFoundLastStandsInFront) {
  Hypotheses found(FourRules());
  found.Add(kDrift, "Drifts.", InFront("session_time_s"));
  found.Add(kStain, "", InFront("radius"));
  UnexplainedRest rest;
  rest.covariates = {{"incidence_deg", 0, 0}};
  found.DescribeRest(&rest);
  EXPECT_THAT(Names(rest), ElementsAre("radius", "session_time_s", "incidence_deg"));
  EXPECT_EQ(rest.words, "Drifts.");
}

// An improvement by one step, concluded beside these hypotheses.
Improvement ConcludedBeside(const std::vector<int>& hypotheses, double explained_share) {
  Hypotheses found(FourRules());
  for (const int hypothesis : hypotheses) found.Add(hypothesis);
  Improvement improvement;
  improvement.steps.resize(1);
  improvement.steps[0].probability = 0.99;
  improvement.improved.name = "rig";
  improvement.changed = true;
  Conclude(found, explained_share, &improvement);
  return improvement;
}

TEST(Conclude, NamesStepsWhereNothingIsLeft) {
  const Improvement improvement = ConcludedBeside({}, 1);
  EXPECT_EQ(improvement.verdict, Verdict::kMissingEffects);
  EXPECT_EQ(improvement.steps[0].probability, 0.99);
  EXPECT_EQ(improvement.improved.name, "rig_better");
}

TEST(Conclude, DoubtsStepsBesideWhatIsLeftOfTheMeansAlone) {
  EXPECT_EQ(ConcludedBeside({kNoiseOfPart}, 0.5).verdict, Verdict::kUnexplained);
  EXPECT_EQ(ConcludedBeside({kNoiseOfPart}, 0.5).steps[0].probability, 0.99);
  EXPECT_DOUBLE_EQ(ConcludedBeside({kDrift}, 0.5).steps[0].probability, 0.7);  // halfway from 0.5 to 0.9
  EXPECT_DOUBLE_EQ(ConcludedBeside({kDrift}, 1).steps[0].probability, 0.9);
  EXPECT_DOUBLE_EQ(ConcludedBeside({kDrift, kStain}, 1).steps[0].probability, 0.5);
}

TEST(VerdictOf, SaysWhatIsLeftBeforeStepsAndStepsBeforeValues) {
  EXPECT_EQ(VerdictOf(true, true, true), Verdict::kUnexplained);
  EXPECT_EQ(VerdictOf(false, true, true), Verdict::kMissingEffects);
  EXPECT_EQ(VerdictOf(false, false, true), Verdict::kWrongValues);
  EXPECT_EQ(VerdictOf(false, false, false), Verdict::kAdequate);
}

TEST(KeepGivenIfWorse, TakesBackValuesThatCompareWorseAndNoStep) {
  Improvement improvement;
  improvement.values_wrong = improvement.changed = true;
  improvement.superfluous = {"gravity_sag"};
  EXPECT_FALSE(KeepGivenIfWorse({}, {2, 2, 0}, {1, 1, 0}, &improvement));
  improvement.steps.resize(1);
  EXPECT_FALSE(KeepGivenIfWorse({}, {1, 1, 0}, {2, 2, 0}, &improvement));
  improvement.steps.clear();
  EXPECT_TRUE(KeepGivenIfWorse({}, {1, 1, 0}, {2, 2, 0}, &improvement));
  EXPECT_FALSE(improvement.changed || improvement.values_wrong);
  EXPECT_THAT(improvement.superfluous, IsEmpty());
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
