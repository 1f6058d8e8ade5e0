#include "tests/hidden_effects/generator/data_errors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::hidden {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const char kHeader[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n";
const char kFirst[] = "0,cup,20,60,1,2,3,0,0,-1,1,0,0,0,500,20000\n";
const char kSecond[] = "1,jar,20,60,4,5,6,0,1,0,0,0,1,,300,0\n";

std::string Mistaken(DataErrorKind kind, double number = 0, std::vector<int> which = {}) {
  return WithDataError(std::string(kHeader) + kFirst + kSecond, {kind, number, std::move(which)});
}

std::string Rows(const std::string& rows) {
  return kHeader + rows;
}

TEST(DataError, ReversesDirections) {
  EXPECT_EQ(Mistaken(DataErrorKind::kLateralReversed), Rows("0,cup,20,60,1,2,3,0,0,-1,-1,-0,-0,0,500,20000\n"
                                                            "1,jar,20,60,4,5,6,0,1,0,-0,-0,-1,,300,0\n"));
  EXPECT_THAT(Mistaken(DataErrorKind::kApproachReversed),
              HasSubstr("1,jar,20,60,4,5,6,-0,-1,-0,0,0,1,,300,0\n"));
}

TEST(DataError, MixesUpFingers) {
  EXPECT_EQ(Mistaken(DataErrorKind::kFingersPermuted, 0, {1, 2, 0}),
            Rows("0,cup,20,60,1,2,3,0,0,-1,1,0,0,500,20000,0\n"
                 "1,jar,20,60,4,5,6,0,1,0,0,0,1,300,0,\n"));
}

TEST(DataError, MixesUpObjects) {
  EXPECT_THAT(Mistaken(DataErrorKind::kObjectsSwapped, 0, {0, 1}), HasSubstr("0,jar,20,60,1,2,3,"));
  EXPECT_THAT(Mistaken(DataErrorKind::kObjectsSwapped, 0, {0, 1}), HasSubstr("1,cup,20,60,4,5,6,"));
  EXPECT_THAT(Mistaken(DataErrorKind::kWrongObject, 0, {0, 1}), HasSubstr("0,jar,20,60,1,2,3,"));
  EXPECT_THAT(Mistaken(DataErrorKind::kWrongObject, 0, {0, 1}), HasSubstr("1,jar,20,60,4,5,6,"));
}

TEST(DataError, WritesOtherUnits) {
  EXPECT_EQ(Mistaken(DataErrorKind::kTimeUnits, 0.001), Rows("0,cup,20,60,1,2,3,0,0,-1,1,0,0,0,0.5,20\n"
                                                             "1,jar,20,60,4,5,6,0,1,0,0,0,1,,0.3,0\n"));
  EXPECT_THAT(Mistaken(DataErrorKind::kSpeedFactor, 2), HasSubstr("0,cup,40,60,1,2,3,"));
  EXPECT_THAT(Mistaken(DataErrorKind::kLengthUnits, 0.1), HasSubstr("0,cup,20,6,0.1,0.2,0.3,0,0,-1,"));
}

TEST(DataError, MovesTheFrame) {
  EXPECT_THAT(Mistaken(DataErrorKind::kObjectLower, 20), HasSubstr("0,cup,20,60,1,2,23,0,0,-1,1,0,0,"));
  // y goes to z.
  EXPECT_THAT(Mistaken(DataErrorKind::kFrameTurned, 90), HasSubstr("0,cup,20,60,1,-3,2,"));
}

TEST(DataError, ShiftsSortsAndCopiesRows) {
  EXPECT_EQ(Mistaken(DataErrorKind::kRowsShifted, 0, {1}),
            Rows("0,cup,20,60,1,2,3,0,0,-1,1,0,0,,300,0\n"
                 "1,jar,20,60,4,5,6,0,1,0,0,0,1,0,500,20000\n"));
  EXPECT_EQ(Mistaken(DataErrorKind::kColumnSorted, 0, {2}),
            Rows("0,cup,20,60,1,2,3,0,0,-1,1,0,0,0,500,0\n1,jar,20,60,4,5,6,0,1,0,0,0,1,,300,20000\n"));
  EXPECT_EQ(Mistaken(DataErrorKind::kCopies, 0.5, {2}),
            Rows(std::string(kFirst) + kSecond + "2,jar,20,60,4,5,6,0,1,0,0,0,1,,300,0\n" +
                 "3,jar,20,60,4,5,6,0,1,0,0,0,1,,300,0\n"));
}

TEST(DataError, HasTheNamesThatSayTheSame) {
  EXPECT_THAT(ProblemKinds({DataErrorKind::kFingersPermuted, 0, {1, 0, 2}}), ElementsAre("finger_order"));
  // The outer two swapped is the same as a row that points the other way.
  EXPECT_THAT(ProblemKinds({DataErrorKind::kFingersPermuted, 0, {2, 1, 0}}),
              ElementsAre("finger_order", "lateral_reversed"));
  for (int kind = 0; kind <= static_cast<int>(DataErrorKind::kCopies); ++kind)
    EXPECT_FALSE(ProblemKinds({static_cast<DataErrorKind>(kind), 0, {}}).empty());
}

}  // namespace
}  // namespace touchstone::hidden
