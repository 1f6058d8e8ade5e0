#include "server/touch/commanded_touch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace touchstone::touch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string MessageOf(const CommandedTouch& touch) {
  CommandedTouch copy = touch;
  return std::string(MakeExact(&copy, "touches[3]").message());
}

TEST(CommandedTouch, AlmostUnitAndPerpendicularVectorsAreMadeExact) {
  CommandedTouch touch;
  touch.approach = {0, 0.0005, -1.0002};
  touch.lateral = {0.9995, 0, 0.0004};
  ASSERT_TRUE(MakeExact(&touch, "").ok());
  EXPECT_NEAR(touch.approach.norm(), 1, 1e-15);
  EXPECT_NEAR(touch.lateral.norm(), 1, 1e-15);
  EXPECT_NEAR(touch.approach.dot(touch.lateral), 0, 1e-15);
}

TEST(CommandedTouch, ErrorsNameFieldValueAndWhatWouldBeRight) {
  CommandedTouch zero, oblique, infinite, slow, nameless;
  zero.approach.setZero();
  EXPECT_THAT(MessageOf(zero), AllOf(HasSubstr("touches[3].approach = (0, 0, 0)"), HasSubstr("unit vector")));
  oblique.lateral = Eigen::Vector3d(1, 0, 0.01).normalized();
  EXPECT_THAT(MessageOf(oblique), AllOf(HasSubstr("touches[3].lateral"), HasSubstr("perpendicular")));
  infinite.target_m.x() = NAN;
  EXPECT_THAT(MessageOf(infinite), AllOf(HasSubstr("target_m = (nan, 0, 0)"), HasSubstr("finite")));
  slow.speed_m_s = 0;
  EXPECT_THAT(MessageOf(slow), AllOf(HasSubstr("speed_m_s = 0"), HasSubstr("above 0")));
  nameless.covariates["temperature"] = 20;
  EXPECT_THAT(MessageOf(nameless), HasSubstr("begin with 'cov_'"));
}

}  // namespace
}  // namespace touchstone::touch
