#include <gtest/gtest.h>
#include <cmath>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ToolYaw, TurnsTheRowOfFingersRightHandedAboutTheApproach) {
  TouchBatch touches = TestBatch(1, 3);
  touches.approach[0] = Eigen::Vector3d(0, 0, -1);
  touches.lateral[0] = Eigen::Vector3d(1, 0, 0);
  ApplyByName("tool_yaw", {{"angle_deg", {30}}}, &touches);
  // About -z the x axis turns towards -y.
  EXPECT_TRUE(touches.lateral[0].isApprox(Eigen::Vector3d(std::sqrt(0.75), -0.5, 0), 1e-15));
}

TEST(ToolYaw, KeepsTheRowAUnitVectorSquareToTheApproach) {
  TouchBatch touches = TestBatch(50, 3);
  ApplyByName("tool_yaw", {{"angle_deg", {-41}}}, &touches);
  for (int i = 0; i < touches.size(); ++i) {
    EXPECT_NEAR(touches.lateral[i].norm(), 1, 1e-14);
    EXPECT_NEAR(touches.lateral[i].dot(touches.approach[i]), 0, 1e-14);
  }
}

}  // namespace
}  // namespace touchstone::effects
