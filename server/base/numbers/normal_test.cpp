#include "server/base/numbers/normal.h"

#include <cmath>

#include <gtest/gtest.h>

namespace touchstone {
namespace {

TEST(NormalQuantile, LeavesTwoAndAHalfPerCentAbove) {
  EXPECT_NEAR(0.5 * std::erfc(kNormalQuantile975 / std::sqrt(2.0)), 0.025, 1e-15);
}

TEST(NormalQuantile, LeavesAFifthAbove) {
  EXPECT_NEAR(0.5 * std::erfc(kNormalQuantile80 / std::sqrt(2.0)), 0.2, 1e-15);
}

}  // namespace
}  // namespace touchstone
