#include <gtest/gtest.h>
#include <cmath>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ObjectPose, RotatesAboutTheMeshOriginAndThenMoves) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("object_pose", {{"translation_mm", {1, 2, 3}}, {"rotation_deg", {0, 0, 90}}}, &touches);
  const Eigen::Vector3d point_in_mesh(0.1, 0, 0);
  const Eigen::Vector3d point = touches.surface_translation_m + touches.surface_rotation * point_in_mesh;
  EXPECT_TRUE(point.isApprox(Eigen::Vector3d(0.001, 0.102, 0.003), 1e-12)) << point.transpose();
}

TEST(ObjectPose, TurnsByTheLengthOfTheRotationVector) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("object_pose", {{"rotation_deg", {3, -4, 12}}}, &touches);
  EXPECT_NEAR(std::acos((touches.surface_rotation.trace() - 1) / 2), 13 * kRadiansPerDegree, 1e-12);
  const Eigen::Vector3d axis(3, -4, 12);
  EXPECT_TRUE((touches.surface_rotation * axis).isApprox(axis, 1e-12));
}

}  // namespace
}  // namespace touchstone::effects
