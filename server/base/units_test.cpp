#include "server/base/units.h"

#include <gtest/gtest.h>

namespace touchstone {
namespace {

TEST(Units, ConvertToSiAndBack) {
  EXPECT_DOUBLE_EQ(ToSi(Unit::kMillimetre, 30), 0.030);
  EXPECT_DOUBLE_EQ(ToSi(Unit::kDegree, 180), kPi);
  EXPECT_DOUBLE_EQ(ToSi(Unit::kMicrosecond, 5000), 0.005);
  EXPECT_DOUBLE_EQ(ToSi(Unit::kMillimetrePerHour, 3600), 1e-3);
  EXPECT_DOUBLE_EQ(FromSi(Unit::kMillimetrePerSecond, 0.02), 20);
}

TEST(Units, AreFoundByTheirSymbols) {
  Unit unit;
  ASSERT_TRUE(UnitFromSymbol("mm/s", &unit));
  EXPECT_EQ(unit, Unit::kMillimetrePerSecond);
  EXPECT_FALSE(UnitFromSymbol("furlong", &unit));
}

}  // namespace
}  // namespace touchstone
