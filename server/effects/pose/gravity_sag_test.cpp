#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(GravitySag, LowersTheTipsAlongMinusZ) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("gravity_sag", {{"drop_mm", {1.5}}}, &touches);
  EXPECT_TRUE(touches.tip_displacement_m.isApprox(Eigen::Vector3d(0, 0, -0.0015)));
}

}  // namespace
}  // namespace touchstone::effects
