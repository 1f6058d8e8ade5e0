#include "server/session/measurements/touch_content.h"

#include <absl/strings/str_replace.h>
#include <gtest/gtest.h>

#include "server/base/text/text.h"

namespace touchstone::session {
namespace {

const char kSet[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n"
    "0,cup,20,60,1,2,3,0,0,-1,1,0,0,1000.5,0,2500\n"
    "1,cup,20,60,1,2,4,0,0.6,-0.8,1,0,0,1300,0,\n";

std::string HashOf(const std::string& csv) {
  return TouchContentSha256(*ParseMeasurementSet(csv, "set.csv"));
}

TEST(TouchContent, IsThatOfACopyInAnotherForm) {
  const std::string hash = HashOf(kSet);
  EXPECT_EQ(hash.size(), 64u);
  EXPECT_EQ(HashOf(absl::StrReplaceAll(kSet, {{"\n", "\r\n"}})), hash);
  EXPECT_EQ(HashOf(absl::StrReplaceAll(kSet, {{"1000.5", "1000.50"}, {",20,60", ",20.0,6e1"}})), hash);
  // Other names and numbers, a column more, columns and rows in another order.
  EXPECT_EQ(HashOf("t_r_us,t_m_us,t_l_us,touch,object,cov_day,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,"
                   "target_z_mm,"
                   "approach_x,approach_y,approach_z,lateral_x,lateral_y,lateral_z\n"
                   ",0,1300,7,mug,1,20,60,1,2,4,0,0.6,-0.8,1,0,0\n"
                   "2500,0,1000.5,9,mug,1,20,60,1,2,3,0,0,-1,1,0,0\n"),
            hash);
}

TEST(TouchContent, IsAnotherWhereATouchDiffers) {
  const std::string hash = HashOf(kSet);
  for (const auto& [from, to] : {std::pair{"1000.5", "1000.6"}, std::pair{"1300,0,\n", "1300,0,0\n"},
                                 std::pair{",1,2,3,", ",1,2,3.001,"}, std::pair{"1,cup,20", "1,cup,21"}})
    EXPECT_NE(HashOf(absl::StrReplaceAll(kSet, {{from, to}})), hash) << from;
  const std::string twice = absl::StrReplaceAll(kSet, {{"1,cup,20,60,1,2,4,0,0.6,-0.8,1,0,0,1300,0,\n", ""}});
  EXPECT_NE(HashOf(twice), hash);
}

TEST(TouchContent, OfASetWithoutPosesIsThatOfItsTimes) {
  EXPECT_EQ(HashOf("object,t_0_us,t_1_us\na,1,2\na,3,4\n"), HashOf("t_1_us,t_0_us,object\n4,3,b\n2,1,b\n"));
  EXPECT_NE(HashOf("object,t_0_us,t_1_us\na,1,2\n"), HashOf("object,t_0_us,t_1_us\na,2,1\n"));
}

}  // namespace
}  // namespace touchstone::session
