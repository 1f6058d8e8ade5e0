#include "server/diagnosis/engine/ladder/ladder.h"

#include <gtest/gtest.h>

namespace touchstone::diagnosis::engine {
namespace {

TEST(ExplainedShare, IsOfTheMeanSquareErrorBeyondTheNoise) {
  EXPECT_DOUBLE_EQ(ExplainedShare(10, 6, 0), 0.64);
  EXPECT_DOUBLE_EQ(ExplainedShare(10, 6, 6), 1);
  EXPECT_DOUBLE_EQ(ExplainedShare(5, 5, 5), 0);
}

// The kind: a step and a candidate that is no part of the explanation both had probability 0.86.
TEST(Conclude, LeavesToCandidatesBesideTheExplanationWhatThatLeaves) {
  static const std::vector<HypothesisRule> kNone;
  Improvement improvement;
  LadderStep& step = improvement.steps.emplace_back();
  step.effect = "contact_slowdown";
  step.equivalent = {"speed_error"};
  step.probability = 0.86;
  for (const char* effect : {"finger_spacing", "speed_error", "contact_slowdown"}) {
    RankedCandidate& candidate = improvement.candidates.emplace_back();
    candidate.effect = effect;
    candidate.probability = 0.9;
  }
  Conclude(Hypotheses(kNone), 1, &improvement);
  EXPECT_NEAR(improvement.candidates[0].probability, 0.14, 1e-9);
  EXPECT_EQ(improvement.candidates[1].probability, 0.9);
  EXPECT_EQ(improvement.candidates[2].probability, 0.9);
}

TEST(Conclude, TakesAStepWhoseProbabilityIsNotAssessedForNoRival) {
  static const std::vector<HypothesisRule> kNone;
  Improvement improvement;
  improvement.steps.emplace_back().effect = "exposure";
  improvement.steps[0].probability = 1;
  improvement.candidates.emplace_back().effect = "vignetting";
  improvement.candidates[0].probability = 0.4;
  Conclude(Hypotheses(kNone), 1, &improvement);
  EXPECT_EQ(improvement.candidates[0].probability, 0.4);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
