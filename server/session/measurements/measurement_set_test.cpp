#include "server/session/measurements/measurement_set.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "server/base/test_paths.h"
#include "server/base/text/text.h"
#include "server/session/measurements/backward_times.h"

namespace touchstone::session {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const char kPoses[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z";
const char kTimes[] = ",t_l_us,t_m_us,t_r_us";

// A row to kPoses + kTimes.
std::string Row(int touch, const std::string& times = "1000,0,2500") {
  return absl::StrCat(touch, ",cup,20,60,1,2,3,0,0,-1,1,0,0,", times, "\n");
}
std::string Set(const std::string& rows) {
  return absl::StrCat(kPoses, kTimes, "\n", rows);
}
std::string Message(const std::string& csv) {
  return std::string(ParseMeasurementSet(csv, "set.csv").status().message());
}

TEST(MeasurementSet, BeyondALimitNamesItAndItsValue) {
  MeasurementLimits limits;
  limits.max_touches = 2;
  limits.max_objects = 1;
  limits.max_columns = 16;
  limits.max_time_us = 1e10;
  const auto status = [&](const std::string& csv) {
    return ParseMeasurementSet(csv, "set.csv", limits).status();
  };
  EXPECT_TRUE(status(Set(Row(0) + Row(1))).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(status(Set(Row(0) + Row(1) + Row(2)))));
  EXPECT_THAT(std::string(status(Set(Row(0) + Row(1) + Row(2))).message()),
              HasSubstr("set.csv:4: touches: 3: at most 2 (max_session_touches)"));
  EXPECT_THAT(std::string(status("object,t_0_us\na,1\nb,1\n").message()),
              HasSubstr("objects: 2: at most 1 (max_session_objects)"));
  EXPECT_THAT(std::string(status(absl::StrCat(kPoses, kTimes, ",round\n")).message()),
              HasSubstr("columns: 17: at most 16 (max_session_columns)"));
  EXPECT_THAT(std::string(status(Set(Row(0, "2e10,0,1"))).message()), HasSubstr("out of range"));
}

TEST(BackwardTimes, AreRowsBeforeTheRowAboveThem) {
  MeasurementSet set;
  set.object = {0, 0, 0, 0}, set.touch = {4, 5, 6, 7}, set.session_time_s = {0, 12.5, 3, 3};
  EXPECT_EQ(FindBackwardTimes(set).rows, 0) << "it has no times";
  set.has_session_time = true;
  const BackwardTimes backward = FindBackwardTimes(set);
  EXPECT_EQ(backward.rows, 1);
  EXPECT_EQ(backward.touch, 6u);
  EXPECT_EQ(backward.before_s, 12.5);
  EXPECT_EQ(backward.time_s, 3);
}

TEST(MeasurementSet, IsReadInSiUnits) {
  const auto set =
      ParseMeasurementSet(absl::StrCat("cov_temperature,round,face,session_time_s,", kPoses, kTimes, "\n",
                                       "21.5,1,4,12.5,7,cup,20,60,1,-2,3,0,0,-1,1,0,0,1000,,2500\n",
                                       ",2,5,13.5,9,mug,40,60,1,-2,3,0,0,-1,1,0,0,0,0,0\n"),
                          "set.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->size(), 2);
  EXPECT_EQ(set->fingers, 3);
  EXPECT_TRUE(set->has_poses);
  EXPECT_TRUE(set->has_session_time);
  EXPECT_THAT(set->objects, ElementsAre("cup", "mug"));
  EXPECT_THAT(set->object, ElementsAre(0, 1));
  EXPECT_THAT(set->touch, ElementsAre(7, 9));
  EXPECT_THAT(set->line, ElementsAre(2, 3));
  EXPECT_THAT(set->round, ElementsAre(1, 2));
  EXPECT_THAT(set->face, ElementsAre(4, 5));
  EXPECT_THAT(set->session_time_s, ElementsAre(12.5, 13.5));
  EXPECT_DOUBLE_EQ(set->speed_m_s[1], 0.04);
  EXPECT_DOUBLE_EQ(set->standoff_m[0], 0.06);
  EXPECT_DOUBLE_EQ(set->target_m[0].y(), -0.002);
  EXPECT_EQ(set->approach[0], Eigen::Vector3d(0, 0, -1));
  EXPECT_EQ(set->lateral[0], Eigen::Vector3d(1, 0, 0));
  EXPECT_DOUBLE_EQ(set->TimeS(0, 2), 0.0025);
  EXPECT_TRUE(std::isnan(set->TimeS(0, 1)));
  EXPECT_DOUBLE_EQ(set->covariates.at("cov_temperature")[0], 21.5);
  EXPECT_TRUE(std::isnan(set->covariates.at("cov_temperature")[1]));
}

TEST(MeasurementSet, MayHaveNoPoses) {
  const auto set = ParseMeasurementSet("object,t_l_us,t_m_us,t_r_us\nlat00,1,0,2\nlat05,,,\n", "set.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_FALSE(set->has_poses);
  EXPECT_THAT(set->touch, ElementsAre(0, 1));
  EXPECT_TRUE(set->target_m.empty());
  EXPECT_TRUE(std::isnan(set->TimeS(1, 0)));
}

TEST(MeasurementSet, APlanHasNoTimes) {
  const auto set = ParseMeasurementSet(absl::StrCat(kPoses, "\n0,cup,20,60,0,0,0,0,0,-1,1,0,0"), "plan.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->fingers, 0);
  EXPECT_TRUE(set->time_s.empty());
}

TEST(MeasurementSet, FingersOtherThanThreeAreNumbered) {
  const auto set = ParseMeasurementSet("object,t_1_us,t_0_us\ncup,5,7\n", "set.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->fingers, 2);
  EXPECT_DOUBLE_EQ(set->TimeS(0, 0), 7e-6);
  EXPECT_THAT(Message("object,t_0_us,t_2_us\ncup,5,7\n"),
              HasSubstr("finger 1 is missing: a column 't_1_us'"));
  EXPECT_THAT(Message("object,t_l_us,t_m_us\ncup,5,7\n"),
              HasSubstr("finger 2 is missing: a column 't_r_us'"));
  EXPECT_THAT(Message("object,t_l_us,t_m_us,t_2_us\n"), HasSubstr("mixed"));
  EXPECT_THAT(Message("object,t_l_us,t_m_us,t_r_us,t_3_us\n"), HasSubstr("mixed"));
  EXPECT_THAT(Message("object,t_16_us\n"), HasSubstr("is no column of a measurement file"));
}

TEST(MeasurementSet, LineEndsMarksAndQuotesOfSpreadsheetsAreRead) {
  const std::string plain = Set(Row(0) + Row(1));
  for (const std::string& text :
       {"\xEF\xBB\xBF" + plain, absl::StrReplaceAll(plain, {{"\n", "\r\n"}}),
        plain.substr(0, plain.size() - 1), plain + "\r\n\n", absl::StrReplaceAll(plain, {{"cup", "\"cup\""}}),
        absl::StrReplaceAll(plain, {{"object", " \"object\" "}, {",20,", ", 20 ,"}})}) {
    const auto set = ParseMeasurementSet(text, "set.csv");
    ASSERT_TRUE(set.ok()) << set.status();
    EXPECT_EQ(set->size(), 2);
    EXPECT_THAT(set->objects, ElementsAre("cup"));
    EXPECT_DOUBLE_EQ(set->speed_m_s[1], 0.02);
  }
  const auto set =
      ParseMeasurementSet("object,t_0_us\n\"a \"\"big\"\" cup, red\",1\ntasse à thé,2\n", "set.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_THAT(set->objects, ElementsAre("a \"big\" cup, red", "tasse à thé"));
}

TEST(MeasurementSet, VectorsAreMadeExactAndExactOnesStay) {
  const auto set = ParseMeasurementSet(
      absl::StrCat(kPoses, kTimes, "\n0,cup,20,60,0,0,0,0,0.0005,-1,1.0004,0,0.0003,1,2,3\n"), "set.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_NEAR(set->approach[0].norm(), 1, 1e-15);
  EXPECT_NEAR(set->lateral[0].norm(), 1, 1e-15);
  EXPECT_NEAR(set->approach[0].dot(set->lateral[0]), 0, 1e-15);
  // Written out and read again, nothing changes any more.
  std::string row = "0,cup,20,60,0,0,0";
  for (const Eigen::Vector3d& v : {set->approach[0], set->lateral[0]})
    for (int i = 0; i < 3; ++i) absl::StrAppend(&row, ",", ShortestNumber(v[i]));
  const auto again = ParseMeasurementSet(Set(row + ",1,2,3"), "set.csv");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->approach[0], set->approach[0]);
  EXPECT_EQ(again->lateral[0], set->lateral[0]);
}

TEST(MeasurementSet, WrongFieldsAreNamedWithLineColumnAndWhatWasExpected) {
  const auto with = [](const std::string& row) { return Message(Set(Row(0) + row)); };
  EXPECT_EQ(with("1,cup,fast,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"),
            "set.csv:3: column speed_mm_s: 'fast' is not a number; one like 12.5 was expected (field 3 of "
            "the row)");
  EXPECT_THAT(
      with("1,cup,20,60,0,0,0,0,0,-1,1,0,0,nan,2,3\n"),
      HasSubstr("set.csv:3: column t_l_us: 'nan' is not a finite number; where a finger reported nothing"));
  EXPECT_THAT(with("1,cup,20,60,-inf,0,0,0,0,-1,1,0,0,1,2,3\n"),
              HasSubstr("column target_x_mm: '-inf' is not a finite number"));
  EXPECT_THAT(with("1,cup,20,60,1e999,0,0,0,0,-1,1,0,0,1,2,3\n"),
              HasSubstr("target_x_mm: '1e999' is beyond"));
  EXPECT_THAT(with("1,cup,20,60,0x10,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("'0x10' is not a number"));
  EXPECT_THAT(with("1,cup,20,60,+-1,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("'+-1' is not a number"));
  EXPECT_THAT(with("1,cup,,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("column speed_mm_s: is empty"));
  EXPECT_THAT(with("1,,20,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("column object: is empty; a name"));
  EXPECT_THAT(with("1,c\x01p,20,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("'c\\x01p' is no name"));
  EXPECT_THAT(with("1,c\xFFp,20,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("'c\\xffp' is no name"));
  EXPECT_THAT(with("1,cup,0,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("speed_mm_s: 0 is out of range"));
  EXPECT_THAT(with("1,cup,20,-1,0,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("standoff_mm: -1 is out of range"));
  EXPECT_THAT(with("1,cup,20,60,0,0,0,0,0,-1,1,0,0,1,-2,3\n"), HasSubstr("t_m_us: -2 is out of range"));
  EXPECT_THAT(with("1,cup,20,60,0,0,0,0,0,-1.1,1,0,0,1,2,3\n"),
              HasSubstr("approach_z: (0, 0, -1.1) has length 1.1"));
  EXPECT_THAT(with("1,cup,20,60,0,0,0,0,0,-1,0.6,0,0.8,1,2,3\n"), HasSubstr("dot product is -0.8"));
  EXPECT_THAT(with("1,cup,20,60,0,0,0,0,0,-1,1,0,0,1,2\n"),
              HasSubstr("set.csv:3: has 15 columns, the header has 16"));
  EXPECT_THAT(with("-1,cup,20,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"), HasSubstr("touch: -1 is not a whole number"));
  EXPECT_THAT(with("1.5,cup,20,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"),
              HasSubstr("touch: 1.5 is not a whole number"));
  EXPECT_THAT(with("1,\"cup,20,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"),
              HasSubstr("set.csv:3: field 2 begins with a quote"));
  EXPECT_THAT(with("1,\"cup\"x,20,60,0,0,0,0,0,-1,1,0,0,1,2,3\n"),
              HasSubstr("goes on after its closing quote"));
  EXPECT_THAT(Message(absl::StrCat("session_time_s,", kPoses, kTimes, "\n-3,", Row(0))),
              HasSubstr("session_time_s: -3 is out of range"));
  EXPECT_THAT(Message(absl::StrCat("round,", kPoses, kTimes, "\n1.5,", Row(0))),
              HasSubstr("round: 1.5 is not"));
  EXPECT_THAT(Message(absl::StrCat("cov_a,", kPoses, kTimes, "\nnan,", Row(0))), HasSubstr("cov_a: 'nan'"));
}

TEST(MeasurementSet, WrongHeadersAreNamed) {
  EXPECT_THAT(Message(""), HasSubstr("set.csv:1: a header line was expected"));
  EXPECT_THAT(Message("\n1,2\n"), HasSubstr("a header line was expected"));
  EXPECT_THAT(Message(Set("")), HasSubstr("has a header but no touch"));
  EXPECT_THAT(Message(Set("\r\n\n")), HasSubstr("has a header but no touch"));
  EXPECT_THAT(Message(absl::StrCat(kPoses, ",sesion_time_s\n")), HasSubstr("did you mean 'session_time_s'?"));
  EXPECT_THAT(Message(absl::StrCat(kPoses, ",object\n")), HasSubstr("'object' stands twice in the header"));
  EXPECT_THAT(Message(absl::StrCat(kPoses, ",\n")), HasSubstr("column 14 '' has no name"));
  EXPECT_THAT(Message(absl::StrCat(kPoses, ",cov_a-b\n")), HasSubstr("is no name of a covariate"));
  EXPECT_THAT(Message("0,cup,20\n"), HasSubstr("column 1 '0' is no column"));
  EXPECT_THAT(Message("touch,t_l_us,t_m_us,t_r_us\n"), HasSubstr("column 'object' is missing"));
  EXPECT_THAT(Message("touch,object\n"), HasSubstr("column 'speed_mm_s' is missing; so are times"));
  for (const char* name : {"touch", "standoff_mm", "approach_y", "lateral_z"})
    EXPECT_THAT(Message(absl::StrReplaceAll(Set(""), {{name, absl::StrCat("cov_", name)}})),
                HasSubstr(absl::StrCat("set.csv:1: column '", name, "' is missing")));
}

TEST(MeasurementSet, ATouchNumberStandsOnce) {
  EXPECT_THAT(Message(Set(Row(3) + Row(1) + Row(2) + Row(1) + Row(3))),
              HasSubstr("set.csv:5: column touch: 1 stands on line 3 already"));
  EXPECT_TRUE(ParseMeasurementSet(Set(Row(3) + Row(1) + Row(2)), "set.csv").ok());
}

// Whatever is broken, the answer is a set or a message with the file's name and a line.
TEST(MeasurementSet, BrokenBytesNeverDoMoreThanFail) {
  std::string base = absl::StrCat("session_time_s,round,cov_a,", kPoses, kTimes, "\n");
  for (int touch = 0; touch < 8; ++touch)
    absl::StrAppend(&base, touch, ".25,1,\"0.5\",", Row(touch, touch == 3 ? ",0,17" : "1250.5,0,1e3"));
  ASSERT_TRUE(ParseMeasurementSet(base, "set.csv").ok()) << ParseMeasurementSet(base, "set.csv").status();
  std::mt19937_64 random(7);
  const auto below = [&](size_t n) { return static_cast<size_t>(random() % n); };
  const char kTricky[] = "\",\n\r;+-.eEnfxi0 \t\0\xEF\xBB\xFF";
  int failed = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    std::string text = base;
    for (size_t change = 1 + below(4); change > 0 && !text.empty(); --change) {
      const size_t at = below(text.size());
      switch (below(6)) {
        case 0:
          text[at] = static_cast<char>(random());
          break;
        case 1:
          text[at] = kTricky[below(sizeof kTricky)];
          break;
        case 2:
          text.insert(at, 1, kTricky[below(sizeof kTricky)]);
          break;
        case 3:
          text.erase(at, 1 + below(20));
          break;
        case 4:
          text.insert(at, text.substr(below(text.size()), below(80)));
          break;
        case 5:
          if (trial % 7 == 0) text.resize(at);
          break;
      }
    }
    const auto set = ParseMeasurementSet(text, "set.csv");
    if (set.ok()) {
      const size_t rows = set->size();
      ASSERT_GT(rows, 0u);
      ASSERT_EQ(set->time_s.size(), rows * set->fingers);
      ASSERT_EQ(set->line.size(), rows);
      ASSERT_EQ(set->touch.size(), rows);
      ASSERT_EQ(set->session_time_s.size(), rows);
      ASSERT_EQ(set->approach.size(), set->has_poses ? rows : 0);
      for (const auto& [name, values] : set->covariates) ASSERT_EQ(values.size(), rows);
      for (const double time_s : set->time_s) ASSERT_FALSE(time_s < 0 || std::isinf(time_s));
      continue;
    }
    ++failed;
    ASSERT_THAT(std::string(set.status().message()), StartsWith("set.csv:")) << text;
    ASSERT_TRUE(absl::ascii_isdigit(set.status().message()[8])) << set.status();
  }
  EXPECT_GT(failed, 10000);
}

TEST(MeasurementSet, KeepsEveryRowOfALargeFile) {
  constexpr int kRows = 100'000;
  std::string text = absl::StrCat("round,face,session_time_s,", kPoses, kTimes, "\n");
  for (int touch = 0; touch < kRows; ++touch)
    absl::StrAppend(
        &text, "0,2,", touch, ".123456,", touch,
        ",lat05,20,60,73.32211794,-37.75543694,-15.70303451,-0.930615211,0.2876003079,-0.2263656157,"
        "-0.06272026578,-0.7346539442,-0.6755366389,22748,0,484816\n");
  const auto set = ParseMeasurementSet(text, "set.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->size(), kRows);
  EXPECT_EQ(set->touch.back(), kRows - 1u);
  EXPECT_EQ(set->time_s.size(), 3u * kRows);
}

TEST(MeasurementSet, PublicSetsAreRead) {
  const std::string folder = SharedData() + "/measurements/";
  for (const char* name :
       {"nothing_hidden", "tip_radius", "two_effects", "unlisted", "surface_error", "object_push"}) {
    if (!std::filesystem::exists(absl::StrCat(folder, name, ".csv")))
      GTEST_SKIP() << folder << name << ".csv is not there";
    const auto set = ReadMeasurementSet(absl::StrCat(folder, name, ".csv"));
    ASSERT_TRUE(set.ok()) << set.status();
    EXPECT_EQ(set->objects.size(), 5u);
    EXPECT_EQ(set->fingers, 3);
    EXPECT_EQ(set->round.size(), static_cast<size_t>(set->size()));
  }
  const auto set = ReadMeasurementSet(folder + "without_poses.csv");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_FALSE(set->has_poses);
}

}  // namespace
}  // namespace touchstone::session
