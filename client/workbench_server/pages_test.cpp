#include "client/workbench_server/pages.h"

#include <gtest/gtest.h>

namespace touchstone::workbench {
namespace {

using std::chrono::seconds;

class PagesTest : public testing::Test {
 protected:
  bool Heard(const std::string& page, bool hidden = false, bool begins = true) {
    bool changed = false;
    EXPECT_TRUE(pages_.Hear(page, {hidden, begins}, now_, &changed).ok());
    return changed;
  }
  Pages pages_;
  Pages::Time now_;
};

TEST_F(PagesTest, HasTheNumberInWhichItCame) {
  EXPECT_TRUE(Heard("a"));
  EXPECT_TRUE(Heard("b"));
  EXPECT_FALSE(Heard("a"));
  EXPECT_EQ(pages_.Name("b"), "page 2");
}

TEST_F(PagesTest, IsGoneOnceItIsNotHeardOfForTenSecondsOrHiddenForTheTimeThatABrowserLetsItSleep) {
  Heard("seen");
  Heard("hidden", /*hidden=*/true);
  now_ += seconds(9);
  EXPECT_TRUE(pages_.IsThere("seen", now_));
  EXPECT_FALSE(pages_.Went(now_));
  now_ += seconds(1);
  EXPECT_FALSE(pages_.IsThere("seen", now_));
  EXPECT_TRUE(pages_.Went(now_));
  EXPECT_FALSE(pages_.Went(now_));
  now_ += seconds(100);
  EXPECT_TRUE(pages_.IsThere("hidden", now_));
  now_ += seconds(40);
  EXPECT_FALSE(pages_.IsThere("hidden", now_));
}

TEST_F(PagesTest, IsClosedUnlessItIsLoadedAgainWithinThreeSeconds) {
  Heard("closed");
  Heard("loaded");
  pages_.SayGoodbye("closed", now_);
  pages_.SayGoodbye("loaded", now_);
  now_ += seconds(2);
  EXPECT_FALSE(Heard("loaded"));
  now_ += seconds(1);
  EXPECT_FALSE(pages_.IsThere("closed", now_));
  EXPECT_TRUE(pages_.IsThere("loaded", now_));
}

TEST_F(PagesTest, IsNotBroughtBackByWhatArrivesAfterItsGoodbye) {
  Heard("a");
  pages_.SayGoodbye("a", now_);
  EXPECT_FALSE(Heard("a", /*hidden=*/true, /*begins=*/false));
  now_ += seconds(3);
  EXPECT_FALSE(pages_.IsThere("a", now_));
  EXPECT_FALSE(Heard("a", /*hidden=*/false, /*begins=*/false));
  EXPECT_FALSE(pages_.IsThere("a", now_));
  EXPECT_TRUE(Heard("a"));
  EXPECT_TRUE(pages_.IsThere("a", now_));
}

TEST_F(PagesTest, KeepsTheNumberOfOneThatComesBack) {
  Heard("a");
  Heard("b");
  now_ += seconds(60);
  EXPECT_TRUE(pages_.Went(now_));
  EXPECT_TRUE(Heard("b"));
  EXPECT_EQ(pages_.Name("b"), "page 2");
  EXPECT_TRUE(Heard("c"));
  EXPECT_EQ(pages_.Name("c"), "page 3");
}

TEST_F(PagesTest, ListsThoseThatAreThereAndTheOneThatIsAskedFor) {
  Heard("a");
  now_ += seconds(60);
  Heard("b", /*hidden=*/true);
  EXPECT_EQ(pages_.List(now_, "").dump(), R"({"b":{"hidden":true,"number":2,"there":true}})");
  EXPECT_EQ(pages_.List(now_, "a")["a"].dump(), R"({"hidden":false,"number":1,"there":false})");
}

TEST_F(PagesTest, AreAtMostAThousandAtOnce) {
  for (int k = 0; k < 1000; ++k) Heard("page-" + std::to_string(k));
  bool changed = false;
  EXPECT_EQ(pages_.Hear("one-more", {}, now_, &changed).code(), absl::StatusCode::kResourceExhausted);
  now_ += std::chrono::minutes(11);
  pages_.Went(now_);
  EXPECT_TRUE(pages_.Hear("one-more", {}, now_, &changed).ok());
}

}  // namespace
}  // namespace touchstone::workbench
