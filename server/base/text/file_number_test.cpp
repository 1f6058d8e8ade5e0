#include "server/base/text/file_number.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/text/over_limit.h"
#include "server/base/touch_limits.h"

namespace touchstone {
namespace {

TEST(FileNumber, IsTheNumberThatWasSent) {
  for (const char* sent : {"12.3", "0.1", "30.1", "0.3", "-87.65", "1e-07", "250.00001", "123456789.125"}) {
    EXPECT_EQ(FileNumber(Unit::kMillimetre, ToSi(Unit::kMillimetre, std::atof(sent))), sent);
    EXPECT_EQ(FileNumber(Unit::kDegree, ToSi(Unit::kDegree, std::atof(sent))), sent);
    EXPECT_EQ(FileNumber(Unit::kNone, std::atof(sent)), sent);
  }
  EXPECT_EQ(FileNumber(Unit::kMillimetre, NAN), "nan");
  EXPECT_EQ(FileNumber(Unit::kMillimetre, -INFINITY), "-inf");
  EXPECT_EQ(VectorText(1e-3 * Eigen::Vector3d(12.3, 0, -30.1), Unit::kMillimetre), "(12.3, 0, -30.1)");
}

TEST(FileNumber, OfAVectorThatIsRefusedIsTheOneThatWasSent) {
  Eigen::Vector3d approach(0, 0, -1.0005), lateral(0.9995, 0, 0.07);
  EXPECT_NE(MakeOrthonormal(&approach, &lateral), VectorFlaw::kNone);
  EXPECT_EQ(VectorText(approach), "(0, 0, -1.0005)");
  EXPECT_EQ(VectorText(lateral), "(0.9995, 0, 0.07)");
}

TEST(OverLimit, QuotesWholeNumbersInFull) {
  EXPECT_EQ(OverLimit("count =", UINT64_MAX, "max", 20000).message(),
            "count = 18446744073709551615: at most 20000 (max)");
}

}  // namespace
}  // namespace touchstone
