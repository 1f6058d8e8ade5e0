#include "server/diagnosis/selection/ladder/hypotheses.h"

#include <gtest/gtest.h>

namespace touchstone::diagnosis::selection {
namespace {

using engine::Hypotheses;
using engine::Leaves;
using H = Hypothesis;

Hypotheses FoundInTouches(const std::vector<int>& hypotheses) {
  Hypotheses found(HypothesisRules());
  for (const int hypothesis : hypotheses) found.Add(hypothesis);
  return found;
}

TEST(HypothesisRules, StandInTheOrderOfTheEnumeration) {
  for (size_t i = 0; i < HypothesisRules().size(); ++i)
    EXPECT_EQ(static_cast<size_t>(HypothesisRules()[i].hypothesis), i) << HypothesisRules()[i].name;
  EXPECT_EQ(static_cast<size_t>(H::kAbsentMemory) + 1, HypothesisRules().size());
}

TEST(HypothesisRules, CorrelatedNoiseIsExplainedAndARandomWalkIsNot) {
  const Hypotheses correlated = FoundInTouches({H::kCorrelatedNoise}),
                   walk = FoundInTouches({H::kRandomWalk});
  EXPECT_FALSE(correlated.Leave(Leaves::kBeside));
  EXPECT_TRUE(walk.Leave(Leaves::kMeans));
  EXPECT_FALSE(walk.Allows(H::kCorrelatedNoise));
  for (const Hypotheses& memory : {correlated, walk}) {
    EXPECT_FALSE(memory.Allows(H::kMisfit));
    EXPECT_FALSE(memory.Allows(H::kRandomDelay));
    EXPECT_TRUE(memory.Allows(H::kNoise));
  }
}

TEST(HypothesisRules, AnObjectThatMovesExcludesNoiseOfTheFingers) {
  for (const int moves : {H::kRemounted, H::kPlay, H::kPartialOffset}) {
    EXPECT_FALSE(FoundInTouches({moves}).Allows(H::kNoise));
    EXPECT_FALSE(FoundInTouches({moves}).Allows(H::kUnevenScatter));
  }
}

TEST(HypothesisRules, AnUnevenScatterSaysNothingAgainstTheMeans) {
  EXPECT_TRUE(FoundInTouches({H::kUnevenScatter}).Leave(Leaves::kBeside));
  EXPECT_FALSE(FoundInTouches({H::kUnevenScatter}).Leave(Leaves::kMeans));
}

TEST(HypothesisRules, OnlyValuesAndRoundsSpeakAgainstTheSteps) {
  for (const engine::HypothesisRule& rule : HypothesisRules())
    EXPECT_EQ(FoundInTouches({rule.hypothesis}).Leave(Leaves::kDoubts),
              rule.hypothesis == H::kRemounted || rule.hypothesis == H::kStrangeValues)
        << rule.name;
}

TEST(HypothesisRules, OneShapeOfScatterIsSaid) {
  for (const auto& [found, other] : std::vector<std::pair<int, int>>{{H::kUnevenScatter, H::kRandomDelay},
                                                                     {H::kUnevenScatter, H::kLopsided},
                                                                     {H::kRandomDelay, H::kLopsided}})
    EXPECT_FALSE(FoundInTouches({found}).Allows(other));
}

TEST(HypothesisRules, AGroupIsSaidBeforeRoundsAndRoundsBeforeStrangeValues) {
  Hypotheses found(HypothesisRules());
  found.Add(H::kTicks, "Ticks.");
  found.Add(H::kStrangeValues, "At bounds.");
  found.Add(H::kRemounted, "Elsewhere in every round.");
  EXPECT_EQ(found.Words(), "Elsewhere in every round.");
  found.Add(H::kCurve, "From touch 480 on.");
  EXPECT_EQ(found.Words(), "From touch 480 on. Elsewhere in every round.");
  found.Add(H::kGroup, "Round 2 differs.");
  EXPECT_EQ(found.Words(), "Round 2 differs.");
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
