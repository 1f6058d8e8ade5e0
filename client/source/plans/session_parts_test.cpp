#include "client/source/plans/session_parts.h"

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
  EXPECT_EQ(request.previous_size(), 0);
}

TEST(SessionParts, APartKnowsTheTwoTouchesBeforeItWhateverTheirObject) {
  const auto session = SessionOf({"a", "a", "b", "a"});
  const v1::TouchRequest request = PartOfSession(session, 3, 100);
  EXPECT_EQ(request.first_index(), 3u);
  ASSERT_EQ(request.previous_size(), 2);
  EXPECT_EQ(request.previous(0).object(), "a");
  EXPECT_EQ(request.previous(1).object(), "b");
  EXPECT_EQ(request.previous(1).touch().session_time_s(), 2);
}

TEST(SessionParts, APartOfManyTouchesOfOneObjectGoesOnFromTheOneBefore) {
  const auto session = SessionOf({"a", "a", "a"});
  const v1::TouchRequest request = PartOfSession(session, 2, 2);
  EXPECT_EQ(PartOfSession(session, 0, 2).touches_size(), 2);
  EXPECT_EQ(request.touches_size(), 1);
  ASSERT_EQ(request.previous_size(), 2);
  EXPECT_EQ(request.previous(1).touch().session_time_s(), 1);
}

}  // namespace
}  // namespace touchstone::client
