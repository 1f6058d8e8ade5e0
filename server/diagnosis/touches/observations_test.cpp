#include "server/diagnosis/touches/observations.h"

#include <gtest/gtest.h>

namespace touchstone::diagnosis::touches {
namespace {

TEST(Pause, IsTheTimeSinceTheSessionsPreviousTouch) {
  auto set = std::make_shared<session::MeasurementSet>();
  set->has_session_time = true;
  set->session_time_s = {7, 1, 4};
  Observations o;
  o.row = {1, 2, 0};  // in the order of the session
  o.previous = {-1, 0, 1};
  o.set = set;
  EXPECT_EQ(PauseS(o, 0), 0);
  EXPECT_EQ(PauseS(o, 1), 3);
  EXPECT_EQ(PauseS(o, 2), 3);
  set->has_session_time = false;
  EXPECT_EQ(PauseS(o, 2), 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::touches
