#include "server/diagnosis/engine/ladder.h"

#include <gtest/gtest.h>

namespace touchstone::diagnosis::engine {
namespace {

const Quality kGiven = {10, 10.5, 0};

TEST(StepWithoutGain, IsNoneWhereBothErrorsFallWithEach) {
  EXPECT_EQ(StepWithoutGain(kGiven, {}), -1);
  EXPECT_EQ(StepWithoutGain(kGiven, {{8, 8.2, 0}, {5, 5.1, 0}}), -1);
}

TEST(StepWithoutGain, IsTheFirstThatLeavesTheErrorOrRaisesIt) {
  EXPECT_EQ(StepWithoutGain(kGiven, {{10, 10.4, 0}}), 0);
  EXPECT_EQ(StepWithoutGain(kGiven, {{8, 8.2, 0}, {9, 8.1, 0}, {5, 5.1, 0}}), 1);
}

// A fit that follows the noise: less error where it was fitted, more elsewhere.
TEST(StepWithoutGain, IsOneThatRaisesTheErrorOnWhatItDidNotSee) {
  EXPECT_EQ(StepWithoutGain(kGiven, {{8, 8.2, 0}, {7, 8.3, 0}}), 1);
}

TEST(StepsAtEnd, HoldAStepThatWasNotLastUntilItIs) {
  StepsAtEnd at_end;
  EXPECT_TRUE(at_end.MoveToEnd(4, {3, 4, 5}));
  EXPECT_EQ(at_end.effects(), std::vector<int>{4});
  EXPECT_FALSE(at_end.MoveToEnd(4, {3, 5, 4}));
}

TEST(StepsAtEnd, HoldNoneThatIsLastOrTheOnlyOne) {
  StepsAtEnd at_end;
  EXPECT_FALSE(at_end.MoveToEnd(5, {3, 4, 5}));
  EXPECT_FALSE(at_end.MoveToEnd(3, {3}));
  EXPECT_TRUE(at_end.effects().empty());
}

TEST(StepsAtEnd, GiveEachAPlaceOnce) {
  StepsAtEnd at_end;
  EXPECT_TRUE(at_end.MoveToEnd(4, {4, 5}));
  EXPECT_TRUE(at_end.MoveToEnd(5, {5, 4}));
  EXPECT_FALSE(at_end.MoveToEnd(4, {4, 5}));
}

TEST(StepsAtEnd, MoveUpWhereAnEffectBeforeThemIsTakenOut) {
  StepsAtEnd at_end;
  at_end.MoveToEnd(4, {4, 5, 6});
  at_end.MoveToEnd(5, {5, 6, 4});
  at_end.TakeOut(4);
  EXPECT_EQ(at_end.effects(), std::vector<int>{4});
}

TEST(ExplainedShare, IsOfTheMeanSquareErrorBeyondTheNoise) {
  EXPECT_DOUBLE_EQ(ExplainedShare(10, 6, 0), 0.64);
  EXPECT_DOUBLE_EQ(ExplainedShare(10, 6, 6), 1);
  EXPECT_DOUBLE_EQ(ExplainedShare(5, 5, 5), 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
