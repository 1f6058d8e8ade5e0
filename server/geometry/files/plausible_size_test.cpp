#include "server/geometry/files/plausible_size.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::geometry {
namespace {

using testing::AllOf;
using testing::HasSubstr;

Bounds Cube(double side_m) {
  return {Eigen::Vector3d::Constant(-0.5 * side_m), Eigen::Vector3d::Constant(0.5 * side_m)};
}

TEST(SizeNote, WhatAHandCanTouchIsNoNote) {
  for (const double side_m : {0.02, 0.15, 2.0}) EXPECT_EQ(SizeNote(Cube(side_m), 0.06), "");
}

TEST(SizeNote, NamesTheUnitThatWouldBeRight) {
  EXPECT_THAT(SizeNote(Cube(0.0008), 0.06, "mm"),
              AllOf(HasSubstr("its longest side is 0.8 mm, implausibly small for fingers that span 60 mm"),
                    HasSubstr("With unit m instead of mm it would be 800 mm")));
  EXPECT_THAT(SizeNote(Cube(150), 0.06, "m"),
              AllOf(HasSubstr("150000 mm, implausibly large"),
                    HasSubstr("With unit mm instead of m it would be 150 mm")));
}

TEST(SizeNote, NamesAScaleWhereNoUnitWouldDo) {
  EXPECT_THAT(SizeNote(Cube(150), 0.06, "mm"), HasSubstr("With scale 0.001 it would be 150 mm"));
}

}  // namespace
}  // namespace touchstone::geometry
