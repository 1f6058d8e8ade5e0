#include <gtest/gtest.h>
#include <cmath>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ToolTilt, LengthensTravelByPositionTimesTangent) {
  TouchBatch touches = TestBatch(2, 4);
  ApplyByName("tool_tilt", {{"angle_deg", {2}}}, &touches);
  const double tangent = std::tan(2 * kRadiansPerDegree);
  for (int touch = 0; touch < 2; ++touch) {
    EXPECT_DOUBLE_EQ(touches.travel_offset_m[touches.At(0, touch)], -0.045 * tangent);
    EXPECT_DOUBLE_EQ(touches.travel_offset_m[touches.At(1, touch)], -0.015 * tangent);
    EXPECT_DOUBLE_EQ(touches.travel_offset_m[touches.At(3, touch)], 0.045 * tangent);
  }
}

TEST(ToolTilt, UsesTheRealSpacingWhereFingerSpacingStandsAboveIt) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("finger_spacing", {{"delta_mm", {5}}}, &touches);
  ApplyByName("tool_tilt", {{"angle_deg", {2}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.travel_offset_m[touches.At(2, 0)], 0.035 * std::tan(2 * kRadiansPerDegree));
}

}  // namespace
}  // namespace touchstone::effects
