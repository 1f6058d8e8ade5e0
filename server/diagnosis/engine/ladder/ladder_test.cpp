#include "server/diagnosis/engine/ladder/ladder.h"

#include <gtest/gtest.h>

namespace touchstone::diagnosis::engine {
namespace {

TEST(ExplainedShare, IsOfTheMeanSquareErrorBeyondTheNoise) {
  EXPECT_DOUBLE_EQ(ExplainedShare(10, 6, 0), 0.64);
  EXPECT_DOUBLE_EQ(ExplainedShare(10, 6, 6), 1);
  EXPECT_DOUBLE_EQ(ExplainedShare(5, 5, 5), 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
