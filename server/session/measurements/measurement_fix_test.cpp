#include "server/session/measurements/measurement_fix.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

namespace touchstone::session {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const char kMendedHeader[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us,cov_note\n";

// The fix of what `set` sets, done to rows below the header; the rows of the result.
std::string FixedText(const std::string& rows, const std::function<void(MeasurementFix*)>& set) {
  MeasurementFix fix;
  set(&fix);
  const auto text = FixMeasurementFile(absl::StrCat(kMendedHeader, rows), "set.csv", fix);
  if (!text.ok()) return std::string(text.status().message());
  EXPECT_EQ(text->substr(0, sizeof(kMendedHeader) - 1), kMendedHeader);
  return text->substr(sizeof(kMendedHeader) - 1);
}

TEST(MeasurementFix, MovesTimesAndKeepsEveryOtherByte) {
  const std::string row = "7, cup,20.0,60,1,2,3,0,0,-1,1,0,0,1000.50,,0,1e0\r\n";
  EXPECT_EQ(FixedText(row,
                      [](auto* f) {
                        f->finger_order = {1, 0, 2};
                      }),
            "7, cup,20.0,60,1,2,3,0,0,-1,1,0,0,,1000.50,0,1e0\r\n");
  EXPECT_EQ(FixedText(row,
                      [](auto* f) {
                        f->finger_order = {1, 2, 0};
                      }),
            "7, cup,20.0,60,1,2,3,0,0,-1,1,0,0,0,1000.50,,1e0\r\n");
}

TEST(MeasurementFix, TurnsVectorsWithTheirDigits) {
  const std::string row = "0,cup,20,60,1.50,2.0,-3,0.60,0,-0.80,0,1.0,0,5,0,7,\n";
  EXPECT_EQ(FixedText(row, [](auto* f) { f->reverse_approach = true; }),
            "0,cup,20,60,1.50,2.0,-3,-0.60,0,0.80,0,1.0,0,5,0,7,\n");
  EXPECT_EQ(FixedText(row, [](auto* f) { f->reverse_lateral = true; }),
            "0,cup,20,60,1.50,2.0,-3,0.60,0,-0.80,0,-1.0,0,5,0,7,\n");
  EXPECT_EQ(FixedText(row, [](auto* f) { f->axes = *ParseAxes("-y,x,z"); }),
            "0,cup,20,60,-2.0,1.50,-3,0,0.60,-0.80,-1.0,0,0,5,0,7,\n");
}

TEST(MeasurementFix, FixesTheTouchesThatAreNamedAndNoOther) {
  const auto row = [](int touch, const std::string& object, const std::string& times) {
    return absl::StrCat(touch, ",", object, ",20,60,1,2,3,0,0,-1,1,0,0,", times, ",\n");
  };
  const std::string rows =
      row(3, "cup", "5,0,7.0") + row(4, "cup", "6,0,8") + row(5, "jug", "0,1,9") + row(9, "cup", "2,3,0");
  EXPECT_EQ(
      FixedText(rows,
                [](auto* f) {
                  f->touches = {{4, 5}};
                  f->finger_order = {1, 0, 2};
                }),
      row(3, "cup", "5,0,7.0") + row(4, "cup", "0,6,8") + row(5, "jug", "1,0,9") + row(9, "cup", "2,3,0"));
  EXPECT_EQ(
      FixedText(rows,
                [](auto* f) {
                  f->touches = {{3, 3}, {9, 9}};
                  f->rename_objects = {{"cup", "jug"}};
                }),
      row(3, "jug", "5,0,7.0") + row(4, "cup", "6,0,8") + row(5, "jug", "0,1,9") + row(9, "jug", "2,3,0"));
  // The last of them gets no times, and none come from or go to the others.
  EXPECT_EQ(FixedText(rows,
                      [](auto* f) {
                        f->touches = {{4, 9}};
                        f->shift_rows = -1;
                      }),
            row(3, "cup", "5,0,7.0") + row(4, "cup", "0,1,9") + row(5, "jug", "2,3,0"));
  EXPECT_THAT(FixedText(rows,
                        [](auto* f) {
                          f->touches = {{6, 8}};
                          f->scale_times = 10;
                        }),
              HasSubstr("has none of these touches"));
}

TEST(MeasurementFix, AnObjectThatNoRowHasAnyMoreIsGone) {
  const auto text = FixMeasurementFile(
      absl::StrCat(kMendedHeader,
                   "3,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n4,jug,20,60,1,2,3,0,0,-1,1,0,0,6,0,8,\n"),
      "set.csv", {});
  ASSERT_TRUE(text.ok());
  MeasurementSet set = *ParseMeasurementSet(*text, "set.csv");
  MeasurementFix fix;
  fix.touches = {{3, 3}};
  fix.rename_objects = {{"cup", "jug"}};
  ASSERT_TRUE(ApplyFix(fix, &set).ok());
  EXPECT_THAT(set.objects, ElementsAre("jug"));
  EXPECT_THAT(set.object, ElementsAre(0, 0));
  EXPECT_EQ(FixOptions(fix, 3), "--touches 3 --rename-object cup=jug");
}

TEST(MeasurementFix, RenamesObjectsAtOnceSoThatTwoCanSwap) {
  const std::string rows =
      "0,\"a,b\",20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n1,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,8,\n";
  EXPECT_EQ(FixedText(rows,
                      [](auto* f) {
                        f->rename_objects = {{"a,b", "cup"}, {"cup", "a,b"}};
                      }),
            "0,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n1,\"a,b\",20,60,1,2,3,0,0,-1,1,0,0,5,0,8,\n");
  EXPECT_THAT(FixedText(rows,
                        [](auto* f) {
                          f->rename_objects = {{"cap", "cup"}};
                        }),
              HasSubstr("has no object 'cap'"));
}

TEST(MeasurementFix, ScalesMovesShiftsAndDrops) {
  const std::string rows =
      "0,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n1,cup,20,60,4,2,3,0,0,-1,1,0,0,6,0,8,\n"
      "2,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,9\n";
  EXPECT_THAT(FixedText(rows, [](auto* f) { f->scale_times = 1000; }), HasSubstr(",0,5000,0,7000,\n1,"));
  EXPECT_THAT(FixedText(rows, [](auto* f) { f->scale_targets = f->scale_standoff = 10; }),
              HasSubstr("0,cup,20,600,10,20,30,0,0,-1"));
  EXPECT_THAT(FixedText(rows, [](auto* f) { f->scale_speed = 0.5; }), HasSubstr("1,cup,10,60,4"));
  EXPECT_THAT(FixedText(rows,
                        [](auto* f) {
                          f->move_objects_m = {{"cup", {0, 0, -0.020}}};
                        }),
              HasSubstr("1,cup,20,60,4,2,23,0"));
  EXPECT_EQ(FixedText(rows, [](auto* f) { f->shift_rows = 1; }),
            "1,cup,20,60,4,2,3,0,0,-1,1,0,0,5,0,7,\n2,cup,20,60,1,2,3,0,0,-1,1,0,0,6,0,8,9\n");
  EXPECT_EQ(FixedText(rows, [](auto* f) { f->shift_rows = -1; }),
            "0,cup,20,60,1,2,3,0,0,-1,1,0,0,6,0,8,\n1,cup,20,60,4,2,3,0,0,-1,1,0,0,5,0,7,\n");
  EXPECT_EQ(FixedText(rows, [](auto* f) { f->drop_duplicates = true; }),
            "0,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n1,cup,20,60,4,2,3,0,0,-1,1,0,0,6,0,8,\n");
  const std::string stale =
      "0,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n1,cup,20,60,4,2,3,0,0,-1,1,0,0,5,0,7,\n"
      "2,cup,20,60,1,2,3,0,0,-1,1,0,0,0,0,0,\n3,cup,20,60,1,2,4,0,0,-1,1,0,0,0,0,0,\n";
  EXPECT_EQ(FixedText(stale, [](auto* f) { f->drop_stale = true; }),
            "0,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n2,cup,20,60,1,2,3,0,0,-1,1,0,0,0,0,0,\n"
            "3,cup,20,60,1,2,4,0,0,-1,1,0,0,0,0,0,\n");
}

TEST(MeasurementFix, RefusesWhatTheSetDoesNotHave) {
  const std::string row = "0,cup,20,60,1,2,3,0,0,-1,1,0,0,5,0,7,\n";
  EXPECT_THAT(FixedText(row,
                        [](auto* f) {
                          f->finger_order = {0, 0, 2};
                        }),
              HasSubstr("each was expected once"));
  EXPECT_THAT(FixedText(row, [](auto* f) { f->scale_times = 0; }), HasSubstr("a factor above 0"));
  EXPECT_THAT(FixedText(row, [](auto* f) { f->shift_rows = 1; }), HasSubstr("cannot be shifted"));
  MeasurementFix fix;
  fix.reverse_lateral = true;
  EXPECT_THAT(
      FixMeasurementFile("object,t_l_us,t_m_us,t_r_us\ncup,1,2,3\n", "set.csv", fix).status().message(),
      HasSubstr("has no poses"));
}

TEST(MeasurementFix, IsSaidAsTheOptionsOfTheCommand) {
  MeasurementFix fix;
  EXPECT_TRUE(fix.empty());
  EXPECT_EQ(FixOptions(fix, 3), "");
  fix.finger_order = {1, 0, 2};
  fix.rename_objects = {{"a", "b"}, {"b", "a"}};
  fix.scale_targets = fix.scale_standoff = 25.4;
  fix.axes = *ParseAxes("-y, x, z");
  fix.move_objects_m = {{"tea cup", {0, 0.0015, -0.02}}};
  EXPECT_EQ(FixOptions(fix, 3),
            "--swap-fingers l,m --swap-objects a,b --scale-lengths 25.4 --permute-axes=-y,x,z "
            "--move-object 'tea cup=0,1.5,-20'");
  fix = {};
  fix.finger_order = {1, 2, 0};
  EXPECT_EQ(FixOptions(fix, 3), "--finger-order m,r,l");
}

TEST(MeasurementFix, ReadsAxesAndRefusesOneThatStandsTwice) {
  EXPECT_EQ(FormatAxes(*ParseAxes("z,-x,+y")), "z,-x,y");
  EXPECT_FALSE(ParseAxes("x,x,z").ok());
  EXPECT_FALSE(ParseAxes("x,y").ok());
  EXPECT_FALSE(ParseAxes("x,y,w").ok());
}

}  // namespace
}  // namespace touchstone::session
