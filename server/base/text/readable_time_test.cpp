#include "server/base/text/readable_time.h"

#include <gtest/gtest.h>

namespace touchstone {
namespace {

TEST(TimeInWords, HasThreeFiguresAndAUnitThatFits) {
  EXPECT_EQ(TimeInWords(0.0091), "9.1 ms");
  EXPECT_EQ(TimeInWords(0.0412), "41.2 ms");
  EXPECT_EQ(TimeInWords(0.041), "41 ms");
  EXPECT_EQ(TimeInWords(0.00041), "410 us");
  EXPECT_EQ(TimeInWords(1.25), "1.25 s");
  EXPECT_EQ(TimeInWords(-0.0091), "-9.1 ms");
}

TEST(TimeInWords, RoundsIntoTheNextUnit) {
  EXPECT_EQ(TimeInWords(0.0009996), "1 ms");
  EXPECT_EQ(TimeInWords(0.9996), "1 s");
}

}  // namespace
}  // namespace touchstone
