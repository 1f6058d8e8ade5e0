#include "server/model/surface_map_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::model {
namespace {

constexpr char kMapText[] =
    "# measured on Monday\n"
    "object,x_mm,y_mm,z_mm,departure_mm,std_dev_mm,length_mm,rms_mm\n"
    "lat00,1,2.5,-3,0.2,0.01,20,0.3\n"
    "\n"
    "lat00,4,5,6,-0.1,0.02,20,0.3\r\n"
    "cup 2,0,0,0,0,0,12,0.1\n";

TEST(SurfaceMapFile, ReadsBackToWhatItWrote) {
  const auto map = ParseSurfaceMap(kMapText, "map.csv");
  ASSERT_TRUE(map.ok()) << map.status();
  ASSERT_EQ(map->size(), 2u);
  const SurfaceMapObject& object = map->at("lat00");
  EXPECT_EQ(object.length_mm, 20);
  EXPECT_EQ(object.rms_mm, 0.3);
  ASSERT_EQ(object.points.size(), 2u);
  EXPECT_THAT(object.points[0].position_mm, testing::ElementsAre(1, 2.5, -3));
  EXPECT_EQ(object.points[1].departure_mm, -0.1);
  EXPECT_EQ(object.points[1].std_dev_mm, 0.02);
  const std::string text = FormatSurfaceMap(*map);
  EXPECT_EQ(FormatSurfaceMap(*ParseSurfaceMap(text, "again.csv")), text);
}

TEST(SurfaceMapFile, ErrorsNameFileLineColumnAndValue) {
  const std::string header = "object,x_mm,y_mm,z_mm,departure_mm,std_dev_mm,length_mm,rms_mm\n";
  const auto error = [&](const std::string& lines) {
    return std::string(ParseSurfaceMap(header + lines, "map.csv").status().message());
  };
  EXPECT_THAT(
      error("a,1,2,3,x,0,20,0.3\n"),
      testing::AllOf(testing::HasSubstr("map.csv:2: column departure_mm"), testing::HasSubstr("'x'")));
  EXPECT_THAT(error("a,1,2,3,nan,0,20,0.3\n"), testing::HasSubstr("map.csv:2: column departure_mm"));
  EXPECT_THAT(error("a,1,2,3,0,-1,20,0.3\n"), testing::HasSubstr("column std_dev_mm: -1 is out of range"));
  EXPECT_THAT(error("a,1,2,3,0,0,0,0.3\n"), testing::HasSubstr("column length_mm: 0 is out of range"));
  EXPECT_THAT(error("a,1,2,3,0,0,20\n"), testing::HasSubstr("map.csv:2: 7 fields; 8 were expected"));
  EXPECT_THAT(error("a,1,2,3,0,0,20,0.3\na,1,2,4,0,0,21,0.3\n"), testing::HasSubstr("map.csv:3: object 'a'"));
  EXPECT_THAT(error(",1,2,3,0,0,20,0.3\n"), testing::HasSubstr("column object"));
  EXPECT_THAT(error(""), testing::HasSubstr("map.csv: no point"));
  EXPECT_THAT(std::string(ParseSurfaceMap("x,y\n", "map.csv").status().message()),
              testing::HasSubstr("map.csv:1: 'x,y'; the header"));
}

}  // namespace
}  // namespace touchstone::model
