#include "client/source/plans/touch_ids.h"

#include <gtest/gtest.h>

#include <set>

namespace touchstone::client {
namespace {

TEST(TouchIds, AreAFunctionOfSessionObjectAndNumber) {
  EXPECT_EQ(TouchId("monday", "lat20", 7), "monday/lat20/7");
  std::set<std::string> ids;
  for (const char* session : {"monday", "tuesday"})
    for (const char* object : {"lat00", "lat20"})
      for (const uint64_t number : {0, 1, 10, 100}) ids.insert(TouchId(session, object, number));
  EXPECT_EQ(ids.size(), 16u);
}

TEST(TouchIds, StayWithin128BytesForEveryName) {
  const std::string session(64, 's');
  const std::string a = TouchId(session, std::string(64, 'a'), ~uint64_t{0});
  const std::string b = TouchId(session, std::string(63, 'a') + "b", ~uint64_t{0});
  EXPECT_LE(a.size(), 128u);
  EXPECT_NE(a, b);
}

TEST(TouchIds, OfNewTouchesDiffer) {
  EXPECT_NE(NewTouchId(0), NewTouchId(1));
  EXPECT_LE(NewTouchId(~uint64_t{0}).size(), 128u);
}

TEST(SessionNames, ComeFromFiles) {
  EXPECT_EQ(SessionNameOf("out/monday plan.csv"), "monday-plan");
  EXPECT_EQ(SessionNameOf("plan.csv"), "plan");
  EXPECT_EQ(SessionNameOf(""), "default");
  EXPECT_TRUE(CheckSessionName(SessionNameOf(std::string(300, 'x') + ".csv"), "").ok());
}

TEST(SessionNames, AreChecked) {
  EXPECT_TRUE(CheckSessionName("monday_1.a-b", "--session").ok());
  for (const std::string& bad :
       {std::string(), std::string("a b"), std::string("a/b"), std::string(65, 'a')}) {
    const absl::Status status = CheckSessionName(bad, "--session");
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_EQ(status.message().find("--session: '"), 0u);
  }
}

}  // namespace
}  // namespace touchstone::client
