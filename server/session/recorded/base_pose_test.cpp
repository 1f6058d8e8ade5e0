#include "server/session/recorded/base_pose.h"

#include <gtest/gtest.h>

#include <cmath>

namespace touchstone::session {
namespace {

TEST(BasePose, ComesBackAsItWas) {
  const std::array<double, 6> pose = {0.3, -0.1, 0.25, 3.1, 0, -0.02};
  const v1::BasePose message = BasePoseMessage(pose);
  EXPECT_EQ(message.position_m().z(), 0.25);
  EXPECT_EQ(message.rotation_rad().x(), 3.1);
  EXPECT_EQ(ParseBasePose(message), pose);
}

TEST(BasePose, IsEmptyWhereItIsUnknown) {
  std::array<double, 6> unknown;
  unknown.fill(std::nan(""));
  const v1::BasePose message = BasePoseMessage(unknown);
  EXPECT_FALSE(message.has_position_m());
  for (const double value : ParseBasePose(message)) EXPECT_TRUE(std::isnan(value));
}

}  // namespace
}  // namespace touchstone::session
