#include "client/source/session_parts.h"

#include <gtest/gtest.h>

namespace touchstone::client {
namespace {

std::vector<MeasuredTouch> SessionOf(const std::vector<std::string>& objects) {
  std::vector<MeasuredTouch> session(objects.size());
  for (size_t k = 0; k < objects.size(); ++k) {
    session[k].object = objects[k];
    session[k].commanded.set_session_time_s(static_cast<double>(k));
  }
  return session;
}

TEST(SessionParts, APartEndsWhereTheObjectChanges) {
  const auto session = SessionOf({"a", "a", "b", "a"});
  const v1::TouchRequest request = PartOfSession(session, 0, 100);
  EXPECT_EQ(request.object(), "a");
  EXPECT_EQ(request.touches_size(), 2);
  EXPECT_FALSE(request.has_previous());
}

TEST(SessionParts, APartKnowsTheTouchBeforeItWhateverItsObject) {
  const auto session = SessionOf({"a", "a", "b", "a"});
  const v1::TouchRequest request = PartOfSession(session, 2, 100);
  EXPECT_EQ(request.first_index(), 2u);
  EXPECT_EQ(request.previous().object(), "a");
  EXPECT_EQ(request.previous().touch().session_time_s(), 1);
}

TEST(SessionParts, APartOfManyTouchesOfOneObjectGoesOnFromTheOneBefore) {
  const auto session = SessionOf({"a", "a", "a"});
  const v1::TouchRequest request = PartOfSession(session, 2, 2);
  EXPECT_EQ(PartOfSession(session, 0, 2).touches_size(), 2);
  EXPECT_EQ(request.touches_size(), 1);
  EXPECT_EQ(request.previous().touch().session_time_s(), 1);
}

}  // namespace
}  // namespace touchstone::client
