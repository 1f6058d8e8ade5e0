#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(ContactSlowdown, SetsTheShareOfSpeedThatIsLost) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("contact_slowdown", {{"fraction", {0.25}}}, &touches);
  EXPECT_EQ(touches.slowdown_fraction, 0.25);
}

}  // namespace
}  // namespace touchstone::effects
