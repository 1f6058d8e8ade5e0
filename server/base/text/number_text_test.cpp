#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/text/text.h"

namespace touchstone {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> Lines(absl::string_view rest) {
  std::vector<std::string> lines;
  for (absl::string_view line; NextLine(&rest, &line);) lines.emplace_back(line);
  return lines;
}

TEST(NextLine, EndsAtEveryKindOfLineEnd) {
  EXPECT_THAT(Lines("a\nb\rc\r\nd\n\re"), ElementsAre("a", "b", "c", "d", "", "e"));
  EXPECT_THAT(Lines("\xEF\xBB\xBF"
                    "a\n\xEF\xBB\xBF"
                    "b"),
              ElementsAre("a", "b"));
  EXPECT_THAT(Lines("a\n"), ElementsAre("a"));
  EXPECT_THAT(Lines(""), ElementsAre());
}

TEST(ParseNumber, TakesTheMinusSignsOfTypesetting) {
  EXPECT_EQ(*ParseNumber("\xE2\x88\x92"
                         "1.65"),
            -1.65);
  EXPECT_EQ(*ParseNumber("\xE2\x80\x93"
                         "2e\xE2\x88\x92"
                         "3"),
            -0.002);
  EXPECT_EQ(*ParseNumber("\xC2\xA0"
                         "7\xE2\x80\xAF"),
            7);
  EXPECT_FALSE(ParseNumber("\xE2\x88\x92").ok());
  EXPECT_FALSE(ParseNumber("1\xE2\x88\x92"
                           "2")
                   .ok());
  EXPECT_FALSE(ParseNumber("\xE2\x88\x92-1").ok());
}

TEST(WhyNoNumber, NamesDatesOfSpreadsheets) {
  for (const char* date :
       {"22.Mai", "5-May", "May-22", "1. Jan", "22.05.2026", "2026-05-22", "5/22/2026", "5/22", "22.05.",
        "12:30:00", "2026-05-22 00:00:00", "2026-05-22T12:30", "3-d\u00E9c.", "02-M\u00E4r"})
    EXPECT_THAT(WhyNoNumber(date), HasSubstr("is a date or a time")) << date;
  for (const char* other : {"fast", "0x10", "maybe", "", "12-", "-1-2", "marble", "lat20"})
    EXPECT_THAT(WhyNoNumber(other), HasSubstr("is not a number; one like 12.5 was expected")) << other;
}

TEST(WhyNoNumber, NamesTheCommaThatShouldBeAPoint) {
  EXPECT_EQ(WhyNoNumber("12,5"), "'12,5' has a comma; 12.5 was expected, with a decimal point");
  EXPECT_THAT(WhyNoNumber("1,2,3"), HasSubstr("is not a number"));
}

}  // namespace
}  // namespace touchstone
