#include "server/session/measurements/measurement_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/base/units.h"

namespace touchstone::session {
namespace {

using ::testing::HasSubstr;

const char kHeader[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z";

std::string WithHeader(const std::string& more_columns, const std::string& rows) {
  return std::string(kHeader) + more_columns + "\n" + rows;
}

TEST(MeasurementCsv, WhatIsWrittenIsReadBackExactly) {
  MeasuredTouch touch;
  touch.touch = 7;
  touch.object = "lat20";
  touch.commanded.set_speed_m_s(ToSi(Unit::kMillimetrePerSecond, 20.1));
  touch.commanded.set_standoff_m(0.1);
  touch.commanded.mutable_target_m()->set_x(ToSi(Unit::kMillimetre, -12.3));
  touch.commanded.mutable_approach()->set_z(-1);
  touch.commanded.mutable_lateral()->set_x(1);
  touch.commanded.set_session_time_s(12.5);
  (*touch.commanded.mutable_covariates())["cov_temperature"] = 21.25;
  touch.time_s = {ToSi(Unit::kMicrosecond, 1250000), std::numeric_limits<double>::quiet_NaN(),
                  ToSi(Unit::kMicrosecond, 1250000.5)};
  const std::string text = FormatMeasurements({touch});
  EXPECT_THAT(text, HasSubstr("t_l_us,t_m_us,t_r_us,session_time_s,cov_temperature\n"));
  EXPECT_THAT(text, HasSubstr("7,lat20,20.1,100,-12.3,0,0,0,0,-1,1,0,0,1250000,,1250000.5,12.5,21.25\n"));
  const auto read = ParseMeasurements(text, "set.csv");
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ((*read)[0].commanded.SerializeAsString(), touch.commanded.SerializeAsString());
  EXPECT_DOUBLE_EQ((*read)[0].time_s[0], 1.25);
  EXPECT_TRUE(std::isnan((*read)[0].time_s[1]));
}

TEST(MeasurementCsv, NamesThatASpreadsheetWouldTakeApartStandInQuotes) {
  MeasuredTouch touch;
  touch.object = "cup, \"blue\"";
  touch.commanded.set_speed_m_s(0.02);
  touch.commanded.mutable_approach()->set_z(-1);
  touch.commanded.mutable_lateral()->set_x(1);
  touch.round = 3;
  touch.face = 2;
  touch.time_s = {0.1};
  const std::string text = FormatMeasurements({touch});
  EXPECT_THAT(text, HasSubstr(",t_0_us,round,face\n"));
  const auto read = ParseMeasurements(text, "set.csv");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ((*read)[0].object, touch.object);
  EXPECT_EQ((*read)[0].round, 3);
  EXPECT_EQ((*read)[0].face, 2);
}

TEST(MeasurementCsv, TimesOfManyDigitsComeBackBitForBit) {
  MeasuredTouch touch;
  touch.object = "cup";
  touch.commanded.set_speed_m_s(0.019999999999999997);
  touch.commanded.mutable_target_m()->set_x(0.1 / 3);
  touch.commanded.mutable_approach()->set_z(-1);
  touch.commanded.mutable_lateral()->set_x(1);
  for (int i = 0; i < 3; ++i) touch.time_s.push_back((20'000'003.0 + i) / 16e6);  // ticks of 62.5 ns
  const std::string text = FormatMeasurements({touch});
  const auto read = ParseMeasurements(text, "set.csv");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ((*read)[0].time_s, touch.time_s);
  EXPECT_DOUBLE_EQ((*read)[0].commanded.target_m().x(), 0.1 / 3);  // no number of millimetres is this one
  EXPECT_EQ(FormatMeasurements(*read), text);
}

TEST(MeasurementCsv, FingersHaveLettersOnlyWhereThereAreThree) {
  EXPECT_EQ(TimeColumnName(0, 3), "t_l_us");
  EXPECT_EQ(TimeColumnName(2, 3), "t_r_us");
  EXPECT_EQ(TimeColumnName(4, 5), "t_4_us");
}

TEST(MeasurementCsv, SpreadsheetsFilesAreRead) {
  const auto read = ParseMeasurements(
      "\xEF\xBB\xBF" + WithHeader("", "0,cup, 20 ,60,0,0,0,0,0,-1,1,0,0\r\n\r\n"), "plan.csv");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_DOUBLE_EQ((*read)[0].commanded.speed_m_s(), 0.02);
  EXPECT_TRUE((*read)[0].time_s.empty());
}

TEST(MeasurementCsv, ErrorsNameFileLineAndColumn) {
  const auto message = [](const std::string& text) {
    return std::string(ParseMeasurements(text, "set.csv").status().message());
  };
  EXPECT_THAT(message(WithHeader("", "0,cup,fast,60,0,0,0,0,0,-1,1,0,0\n")),
              HasSubstr("set.csv:2: column speed_mm_s: 'fast' is not a number"));
  EXPECT_THAT(message(WithHeader("", "0,cup,20,60,0,0,0,0,0,-1,1,0\n")),
              HasSubstr("set.csv:2: has 12 columns, the header has 13"));
  EXPECT_THAT(message(WithHeader("", "0,cup,,60,0,0,0,0,0,-1,1,0,0\n")), HasSubstr("speed_mm_s: is empty"));
  EXPECT_THAT(message(WithHeader("", "0,cup,inf,60,0,0,0,0,0,-1,1,0,0\n")), HasSubstr("not a finite number"));
  EXPECT_THAT(message(WithHeader("", "1.5,cup,20,60,0,0,0,0,0,-1,1,0,0\n")), HasSubstr("column touch: 1.5"));
  EXPECT_THAT(message(WithHeader(",sesion_time_s", "")), HasSubstr("did you mean 'session_time_s'?"));
  EXPECT_THAT(message(WithHeader(",t_l_us,t_r_us", "")), HasSubstr("finger 1 is missing"));
  EXPECT_THAT(message(WithHeader(",t_l_us,t_l_us", "")), HasSubstr("stands twice"));
  EXPECT_THAT(message("touch,object\n"), HasSubstr("column 'speed_mm_s' is missing"));
  EXPECT_THAT(message(""), HasSubstr("a header line was expected"));
  EXPECT_THAT(message(WithHeader("", "")), HasSubstr("has a header but no touch"));
}

}  // namespace
}  // namespace touchstone::session
