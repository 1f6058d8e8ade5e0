#include "server/session/csv/plain_csv.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/session/images/images_csv.h"
#include "server/session/measurements/measurement_csv.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::session {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const char kPlainHeader[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,lateral_x,"
    "lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n";
const char kPlainRows[] =
    "0,cup,20.5,60,-1.6504,0.25,0,-1,0,0,0,0,1,2683692.25,2968789.5,3644912.75\n"
    "1,cup,20.5,60,-0.6504,7.5,0,-1,0,0,0,0,1,2583692.25,,3544912.5\n"
    "2,jug,20.5,60,12.625,7.5,0,-1,0,0,0,0,1,2583694.25,2568789.5,3544912.5\n";

std::string PlainFile() {
  return absl::StrCat(kPlainHeader, kPlainRows);
}

// The same numbers with another separator and decimal commas.
std::string Continental(const std::string& separator) {
  return absl::StrReplaceAll(PlainFile(), {{",", separator}, {".", ","}});
}

std::string AsUtf16(const std::string& ascii) {
  std::string bytes = "\xFF\xFE";
  for (const char c : ascii) bytes += {c, '\0'};
  return bytes;
}

std::string MessageOf(const std::string& csv) {
  return std::string(ParseMeasurements(csv, "set.csv").status().message());
}

void ExpectTheSame(const std::string& csv) {
  const auto read = ParseMeasurements(csv, "set.csv"), plain = ParseMeasurements(PlainFile(), "set.csv");
  ASSERT_TRUE(plain.ok()) << plain.status();
  ASSERT_TRUE(read.ok()) << read.status() << csv;
  EXPECT_EQ(FormatMeasurements(*read), FormatMeasurements(*plain)) << csv;
}

TEST(PlainCsv, WhatOtherProgramsWriteIsReadWhereItIsCertain) {
  ExpectTheSame(absl::StrReplaceAll(PlainFile(), {{"\n", "\r"}}));
  ExpectTheSame(absl::StrReplaceAll(PlainFile(), {{"\n", "\r\n"}}));
  ExpectTheSame(absl::StrReplaceAll(PlainFile(), {{"-", "\xE2\x88\x92"}}));
  ExpectTheSame(absl::StrReplaceAll(PlainFile(), {{",-", ",\xE2\x80\x93"}}));
  for (const char* separator : {";", "\t", "|"}) {
    ExpectTheSame(absl::StrReplaceAll(PlainFile(), {{",", separator}}));
    ExpectTheSame(Continental(separator));
    ExpectTheSame(absl::StrReplaceAll(Continental(separator), {{"\n", "\r"}}));
    ExpectTheSame(absl::StrCat("sep=", separator, "\r\n", Continental(separator)));
  }
  ExpectTheSame("\"sep=;\"\n" + Continental(";"));
  ExpectTheSame("\xEF\xBB\xBFsep=,\n" + PlainFile());
  ExpectTheSame(AsUtf16(PlainFile()));
  ExpectTheSame(AsUtf16(Continental("\t")));
  ExpectTheSame(
      absl::StrCat(kPlainHeader, absl::StrReplaceAll(kPlainRows, {{"20.5", "\"20,5\""},
                                                                  {"-1.6504", "\"-1,6504\""},
                                                                  {"-0.6504", "\"-0,6504\""},
                                                                  {"0.25", "\"0,25\""},
                                                                  {"7.5", "\"7,5\""},
                                                                  {"2683692.25", "\"2683692,25\""},
                                                                  {"2968789.5", "\"2968789,5\""},
                                                                  {"3644912.75", "\"3644912,75\""},
                                                                  {"2583692.25", "\"2583692,25\""},
                                                                  {"3544912.5", "\"3544912,5\""},
                                                                  {"12.625", "\"12,625\""},
                                                                  {"2583694.25", "\"2583694,25\""},
                                                                  {"2568789.5", "\"2568789,5\""}})));
}

TEST(PlainCsv, NamesMayHoldTheSeparatorInQuotesAndCommas) {
  const auto read = ParseMeasurements(
      absl::StrReplaceAll(Continental(";"), {{"jug", "\"a;b\""}, {"cup", "c, d"}}), "set.csv");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ((*read)[0].object, "c, d");
  EXPECT_EQ((*read)[2].object, "a;b");
}

TEST(PlainCsv, CommasThatMayPartThousandsAreNamedWithTheirPlace) {
  // One number has a point: the comma of another is not certain.
  EXPECT_THAT(
      MessageOf(absl::StrReplaceAll(Continental(";"), {{"-1,6504", "-1.6504"}})),
      AllOf(
          HasSubstr(
              "set.csv:2: column speed_mm_s: '20,5' has a comma, but '-1.6504' (line 2, column target_x_mm) "
              "a point"),
          HasSubstr("decimal points and without commas were expected")));
  const std::string thousands =
      absl::StrReplaceAll(absl::StrCat(kPlainHeader, "0,cup,20,60,0,0,0,-1,0,0,0,0,1,2968,3968,4968\n"),
                          {{",", ";"}, {"2968", "2,968"}});
  EXPECT_THAT(MessageOf(thousands),
              HasSubstr("set.csv:2: column t_l_us: '2,968' has a comma that may be a decimal one or part "
                        "thousands"));
  EXPECT_THAT(MessageOf("sep=;\n" + thousands), HasSubstr("set.csv:3: column t_l_us: '2,968'"));
  EXPECT_THAT(MessageOf(absl::StrReplaceAll(PlainFile(), {{"20.5", "\"20,5\""}})),
              HasSubstr("column speed_mm_s: '20,5' has a comma"));
}

TEST(PlainCsv, DatesAndHalfCharactersAreNamedWithTheirPlace) {
  EXPECT_THAT(MessageOf(absl::StrReplaceAll(PlainFile(), {{"12.625", "12.Jun"}})),
              HasSubstr("set.csv:4: column target_x_mm: '12.Jun' is a date or a time, into which "
                        "spreadsheets turn numbers"));
  const std::string bytes = AsUtf16(PlainFile());
  EXPECT_THAT(MessageOf(bytes.substr(0, bytes.size() - 1)),
              HasSubstr("set.csv: line 4: the file ends within a character"));
}

TEST(PlainCsv, ALastLineCutWithinANumberIsNamedWithItsPlace) {
  const std::string whole = PlainFile();
  // Up to the last digit, whose loss changes a time by 0.5 us, every loss of the last field is noticed.
  const size_t field = whole.rfind(',') + 1;
  for (size_t size = field; size < whole.size() - 2; ++size)
    EXPECT_THAT(MessageOf(whole.substr(0, size)),
                AllOf(HasSubstr("set.csv:4: column t_r_us: '"), HasSubstr("may be cut off")))
        << whole.substr(field, size - field);
  for (size_t size = whole.rfind("2,jug") + 1; size < field; ++size)
    EXPECT_THAT(MessageOf(whole.substr(0, size)), HasSubstr("set.csv:4: has")) << size;
  // Without the last line's end alone nothing is missing.
  ExpectTheSame(whole.substr(0, whole.size() - 1));
  EXPECT_THAT(MessageOf(absl::StrReplaceAll(whole, {{"\n", "\r"}}).substr(0, whole.size() - 5)),
              HasSubstr("may be cut off"));
}

TEST(PlainCsv, ANameThatIsCutIsNamedToo) {
  const std::string head = "t_0_us,object\n1,lat20\n2,lat20\n3,";
  const auto message = [&](const char* last) {
    return std::string(ParseMeasurements(head + last, "set.csv").status().message());
  };
  EXPECT_THAT(message("lat2"), HasSubstr("set.csv:4: column object: 'lat2' may be cut off"));
  EXPECT_THAT(message("cup"), HasSubstr("'speed_mm_s' is missing"));  // whole; what it lacks are poses
}

TEST(PlainCsv, ImageSetsAreReadAlike) {
  const std::string plain =
      "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z\n"
      "0,a.png,cup,300.5,0,-2.25,0,0,0,0,0,1\n1,b.png,cup,0,300.5,0,0,0,0,0,0,1\n";
  const auto expected = ParseImagesCsv(plain, "set");
  ASSERT_TRUE(expected.ok()) << expected.status();
  for (const std::string& csv :
       {absl::StrReplaceAll(plain, {{"\n", "\r"}}),
        absl::StrReplaceAll(plain, {{"-2",
                                     "\xE2\x88\x92"
                                     "2"}}),
        "sep=;\n" + absl::StrReplaceAll(plain, {{",", ";"}, {"00.5", "00,5"}, {"2.25", "2,25"}}),
        AsUtf16(plain)}) {
    const auto read = ParseImagesCsv(csv, "set");
    ASSERT_TRUE(read.ok()) << read.status() << csv;
    EXPECT_EQ(FormatImagesCsv(*read), FormatImagesCsv(*expected));
  }
}

TEST(PlainCsv, IsWrittenWhereItIsAskedFor) {
  MeasurementFix fix;
  fix.plain_text = true;
  EXPECT_EQ(FixOptions(fix, 3), "--plain");
  for (const std::string& csv : {PlainFile(), Continental(";"), "sep=;\r\n" + Continental(";"),
                                 AsUtf16(Continental("\t")), absl::StrReplaceAll(PlainFile(), {{"\n", "\r"}}),
                                 "\xEF\xBB\xBF" + absl::StrReplaceAll(PlainFile(), {{"-", "\xE2\x88\x92"}}),
                                 PlainFile().substr(0, PlainFile().size() - 1)}) {
    const auto fixed = FixMeasurementFile(csv, "set.csv", fix);
    ASSERT_TRUE(fixed.ok()) << fixed.status();
    EXPECT_EQ(*fixed, PlainFile());
  }
  // Another fix converts what the readers cannot take as it is, and nothing else.
  MeasurementFix swap;
  swap.finger_order = {1, 0, 2};
  const auto fixed = FixMeasurementFile("sep=;\n" + Continental(";"), "set.csv", swap);
  ASSERT_TRUE(fixed.ok()) << fixed.status();
  EXPECT_EQ(*fixed, *FixMeasurementFile(PlainFile(), "set.csv", swap));
  const auto old_mac = FixMeasurementFile(absl::StrReplaceAll(PlainFile(), {{"\n", "\r"}}), "set.csv", swap);
  ASSERT_TRUE(old_mac.ok()) << old_mac.status();
  EXPECT_EQ(absl::StrReplaceAll(*old_mac, {{"\r", "\n"}}), *fixed);
}

}  // namespace
}  // namespace touchstone::session
