#include "server/base/text/value_text.h"

#include <gtest/gtest.h>

#include <cmath>

namespace touchstone {
namespace {

TEST(ValueText, HasTheDigitsThatTheErrorDeserves) {
  EXPECT_EQ(ValueWithError(2.9812, 0.0211), "2.98 +- 0.02");
  EXPECT_EQ(ValueWithError(2.9812, 0.0123), "2.981 +- 0.012");
  EXPECT_EQ(ValueWithError(20000, 0.001), "20000.00 +- 0.0010");
  EXPECT_EQ(ValueWithError(20000, 130), "20000 +- 130");
  EXPECT_EQ(ValueWithError(-0.001, 0.5), "0.0 +- 0.5");
  EXPECT_EQ(ValueWithError(20, 0), "20");
  EXPECT_EQ(ValueWithError(20, std::nan("")), "20.0");
}

}  // namespace
}  // namespace touchstone
