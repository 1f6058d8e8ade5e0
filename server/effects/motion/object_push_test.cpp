#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ObjectPush, DelaysEveryFingerButTheFirst) {
  const TouchBatch before = TestBatch(30, 3);
  TouchBatch after = before;
  ApplyByName("object_push", {{"shift_mm", {0.3}}}, &after);
  for (int touch = 0; touch < before.size(); ++touch)
    for (int finger = 0; finger < 3; ++finger)
      EXPECT_NEAR(
          after.travel_m[after.At(finger, touch)],
          before.travel_m[before.At(finger, touch)] + (finger == before.first_finger[touch] ? 0 : 0.0003),
          1e-16);
}

}  // namespace
}  // namespace touchstone::effects
