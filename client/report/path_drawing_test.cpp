#include "client/report/path_drawing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/report/occurrences.h"

namespace touchstone::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

DrawnTouch Possible(int number) {
  DrawnTouch touch;
  touch.number = number;
  touch.path = {{0.25, 0, 0.3}, {0.3, 0.01 * number, 0.25}, {0.3, 0.01 * number, 0.15}};
  touch.transit_poses = 2;
  touch.target_m = Eigen::Vector3d(0.3, 0.01 * number, 0.17);
  touch.start.links = {{0, 0, 0},         {0, 0, 0.15},    {0.1, 0, 0.4}, {0.25, 0, 0.45},
                       {0.25, 0.1, 0.45}, {0.3, 0.1, 0.4}, {0.3, 0, 0.37}};
  touch.start.camera = Eigen::Vector3d(0.3, 0.06, 0.33);
  touch.start.tips = {{0.27, 0.01 * number, 0.25}, {0.33, 0.01 * number, 0.25}};
  return touch;
}

DrawnFace Face(const std::string& title, int touches) {
  DrawnFace face;
  face.title = title;
  face.object.emplace();
  for (int k = 0; k < 8; ++k)
    (*face.object)[static_cast<size_t>(k)] = {k & 1 ? 0.35 : 0.25, k & 2 ? 0.05 : -0.05, k & 4 ? 0.15 : 0.05};
  for (int number = 0; number < touches; ++number) face.touches.push_back(Possible(number));
  return face;
}

TEST(DrawPaths, DrawsAPanelPerFaceWithTouchesArmAndCamera) {
  PathDrawing drawing;
  drawing.title = "plan <1> & more";
  drawing.limits = {{-0.5, -0.5, 0}, {0.5, 0.5, 0.7}};
  drawing.faces = {Face("lat20 with its face +z up", 5), Face("lat20 with its face -x up", 2)};
  DrawnTouch impossible;
  impossible.number = 77;
  impossible.possible = false;
  impossible.reason = "out of reach > far";
  impossible.target_m = Eigen::Vector3d(0.4, 0, 0.1);
  drawing.faces[0].touches.push_back(impossible);
  drawing.faces[1].touches[0].notes = {"the approach comes near the wrist singularity"};
  const std::string svg = DrawPaths(drawing);
  EXPECT_EQ(Occurrences(svg, "class=\"panel\""), 4) << "two views per face";
  EXPECT_EQ(Occurrences(svg, "<polyline class=\"approach\""), 7);
  EXPECT_EQ(Occurrences(svg, "<polyline class=\"transit\""), 7);
  EXPECT_EQ(Occurrences(svg, "<polyline class=\"arm\""), 2) << "the whole arm once per face";
  EXPECT_EQ(Occurrences(svg, "<rect class=\"camera\"") - 1, 2) << "and the legend's";
  EXPECT_EQ(Occurrences(svg, "class=\"badnumber\" x"), 1);
  EXPECT_EQ(Occurrences(svg, "<polyline class=\"limits\""), 24);
  EXPECT_EQ(Occurrences(svg, "base frame"), 4) << "every view names its frame";
  for (const char* text :
       {"plan &lt;1&gt; &amp; more", "out of reach &gt; far", "7 of 8 touches are possible",
        "lat20 with its face -x up", "of 1 something is noted", "near the wrist singularity"})
    EXPECT_THAT(svg, HasSubstr(text));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

// A legend of things that are not there makes people look for them.
TEST(DrawPaths, LegendHasWhatIsDrawnAndNothingElse) {
  PathDrawing drawing;
  drawing.faces = {Face("lat20", 1)};
  drawing.faces[0].touches[0].start = DrawnPosture();
  drawing.faces[0].touches[0].path.erase(drawing.faces[0].touches[0].path.begin());
  drawing.faces[0].touches[0].transit_poses = 1;
  std::string svg = DrawPaths(drawing);
  EXPECT_THAT(svg, HasSubstr(">approach</text>"));
  EXPECT_THAT(svg, HasSubstr(">object's box</text>"));
  for (const char* absent : {">impossible</text>", ">transit</text>", ">camera</text>", ">arm</text>",
                             ">fingers</text>", ">tips' limits</text>", ">see note</text>"})
    EXPECT_THAT(svg, Not(HasSubstr(absent)));
  drawing.limits = {{-0.5, -0.5, 0}, {0.5, 0.5, 0.7}};
  drawing.faces[0].touches.push_back(Possible(3));
  svg = DrawPaths(drawing);
  for (const char* present :
       {">transit</text>", ">camera</text>", ">arm</text>", ">fingers</text>", ">tips' limits</text>"})
    EXPECT_THAT(svg, HasSubstr(present));
}

TEST(DrawPaths, NothingToDrawIsAPictureToo) {
  PathDrawing drawing;
  EXPECT_THAT(DrawPaths(drawing), HasSubstr("0 of 0 touches"));
  drawing.faces.emplace_back();
  const std::string svg = DrawPaths(drawing);
  EXPECT_THAT(svg, HasSubstr("</svg>"));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(DrawPaths, LongListsOfReasonsAreCutWithTheirCount) {
  PathDrawing drawing;
  drawing.faces.emplace_back();
  for (int number = 0; number < 30; ++number) {
    DrawnTouch touch;
    touch.number = number;
    touch.possible = false;
    touch.reason = "no";
    drawing.faces[0].touches.push_back(touch);
  }
  EXPECT_THAT(DrawPaths(drawing), HasSubstr("and 22 more"));
}

}  // namespace
}  // namespace touchstone::client
