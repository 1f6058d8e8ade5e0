#include "server/base/text/text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "server/base/test_folder.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

TEST(DidYouMean, NamesTheNearestWord) {
  EXPECT_EQ(DidYouMean("tip_raduis", {"tool_yaw", "tip_radius"}), ", did you mean 'tip_radius'?");
  EXPECT_EQ(DidYouMean("radius", {"radius_mm", "shift_mm"}), ", did you mean 'radius_mm'?");
}

TEST(DidYouMean, ListsWhatIsKnownWhenNothingIsNear) {
  EXPECT_EQ(DidYouMean("ft", {"mm", "m", "inch"}), "; known: mm, m, inch");
  EXPECT_EQ(DidYouMean("xyzzy", {"tool_yaw", "tip_radius"}), "; known: tool_yaw, tip_radius");
}

TEST(Sha256, MatchesThePublishedVector) {
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(ShortestNumber, ReadsBackAsTheSameDouble) {
  for (double value : {0.1, 1e-9, 123456789.123, -0.0})
    EXPECT_EQ(ParseNumber(ShortestNumber(value)).value(), value);
  EXPECT_EQ(ShortestNumber(0.1), "0.1");
}

TEST(ParseNumber, RefusesWordsAndInfinity) {
  EXPECT_THAT(ParseNumber("12x").status().message(), HasSubstr("'12x' is not a number"));
  EXPECT_FALSE(ParseNumber("inf").ok());
}

TEST(DurationInWords, HasTwoUnitsAtMost) {
  EXPECT_EQ(DurationInWords(-1), "0 s");
  EXPECT_EQ(DurationInWords(39.2), "40 s");
  EXPECT_EQ(DurationInWords(250), "4 min 10 s");
  EXPECT_EQ(DurationInWords(7500), "2 h 5 min");
}

TEST(ReadFile, RefusesOneThatIsTooLarge) {
  const TestFolder folder;
  std::ofstream(folder.Path("five")) << "hello";
  EXPECT_THAT(ReadFile(folder.Path("five"), 3).status().message(), HasSubstr("5 bytes"));
}

}  // namespace
}  // namespace touchstone
