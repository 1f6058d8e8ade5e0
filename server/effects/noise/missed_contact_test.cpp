#include <gtest/gtest.h>

#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

TEST(MissedContact, SetsTheProbability) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyByName("missed_contact", {{"probability", {0.01}}}, &touches);
  EXPECT_EQ(touches.missed_probability, 0.01);
}

}  // namespace
}  // namespace touchstone::effects
