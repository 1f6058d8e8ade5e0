#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ObjectScale, GrowsTheSurfaceByItsShare) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("object_scale", {{"relative", {0.02}}}, &touches);
  EXPECT_DOUBLE_EQ(touches.surface_scale, 1.02);
}

}  // namespace
}  // namespace touchstone::effects
