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
  return touch;
}

TEST(DrawPaths, ShowsEveryTouchInBothViews) {
  PathDrawing drawing;
  drawing.title = "plan <1> & more";
  drawing.object = {{0.25, -0.05, 0.05}, {0.35, 0.05, 0.15}};
  drawing.limits = {{-0.5, -0.5, 0}, {0.5, 0.5, 0.7}};
  for (int number = 0; number < 5; ++number) drawing.touches.push_back(Possible(number));
  DrawnTouch impossible;
  impossible.number = 77;
  impossible.possible = false;
  impossible.reason = "out of reach > far";
  impossible.target_m = Eigen::Vector3d(0.4, 0, 0.1);
  drawing.touches.push_back(impossible);
  const std::string svg = DrawPaths(drawing);
  EXPECT_EQ(Occurrences(svg, "<circle class=\"start\""), 10);
  EXPECT_EQ(Occurrences(svg, "<polyline class=\"transit\""), 10);
  EXPECT_EQ(Occurrences(svg, "class=\"badnumber\" x"), 2);
  EXPECT_THAT(svg, HasSubstr("plan &lt;1&gt; &amp; more"));
  EXPECT_THAT(svg, HasSubstr("out of reach &gt; far"));
  EXPECT_THAT(svg, HasSubstr("5 of 6 touches are possible"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(DrawPaths, NothingToDrawIsAPictureToo) {
  const std::string svg = DrawPaths(PathDrawing());
  EXPECT_THAT(svg, HasSubstr("0 of 0 touches"));
  EXPECT_THAT(svg, HasSubstr("</svg>"));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(DrawPaths, LongListsOfReasonsAreCutWithTheirCount) {
  PathDrawing drawing;
  for (int number = 0; number < 30; ++number) {
    DrawnTouch touch;
    touch.number = number;
    touch.possible = false;
    touch.reason = "no";
    drawing.touches.push_back(touch);
  }
  EXPECT_THAT(DrawPaths(drawing), HasSubstr("and 22 more"));
}

}  // namespace
}  // namespace touchstone::client
