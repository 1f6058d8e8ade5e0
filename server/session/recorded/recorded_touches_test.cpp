#include "server/session/recorded/recorded_touches.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "server/base/test_folder.h"
#include "server/session/journal/command_bytes.h"

namespace touchstone::session {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

v1::CommandedTouch Command(double x_m, double speed_m_s = 0.02) {
  v1::CommandedTouch command;
  command.mutable_target_m()->set_x(x_m);
  command.mutable_approach()->set_z(-1);
  command.mutable_lateral()->set_x(1);
  command.set_standoff_m(0.06);
  command.set_speed_m_s(speed_m_s);
  return command;
}

class RecordedTouchesTest : public ::testing::Test {
 protected:
  RecordedTouchesTest() {
    journal_ = *Journal::Open(folder_ + "/session.db", Journal::Mode::kCreateOrReadWrite);
  }
  void Session(const std::string& name, int fingers = 1) {
    JournalSession session;
    session.name = name;
    session.fingers = fingers;
    ASSERT_TRUE(journal_->EnsureSession(session).ok());
  }

  void Add(const std::string& session, const std::string& id, const std::string& object,
           const v1::CommandedTouch& command, TouchStage stage = TouchStage::kDone) {
    JournalTouch touch;
    touch.id = id;
    touch.object = object;
    touch.command = CommandBytes(command);
    touch.stage = stage;
    touch.result.fingers.resize(1);
    const absl::Status added = journal_->AddFinished(session, {touch});
    ASSERT_TRUE(added.ok()) << added;
  }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
  std::unique_ptr<Journal> journal_;
};

TEST_F(RecordedTouchesTest, RepeatsComeInTheirOrderAndRoundAgain) {
  Session("s");
  for (const char* id : {"a", "b", "c"}) Add("s", id, "cup", Command(0.001));
  Add("s", "other", "mug", Command(0.001));
  Add("s", "failed", "cup", Command(0.001), TouchStage::kFailed);
  const auto recorded = RecordedTouches::Read(*journal_);
  ASSERT_TRUE(recorded.ok()) << recorded.status();
  std::string order;
  for (int repeat = 0; repeat < 7; ++repeat) order += (*recorded)->Find("cup", Command(0.001), repeat)->id;
  EXPECT_EQ(order, "abcabca");
  EXPECT_EQ((*recorded)->Find("mug", Command(0.001), 5)->id, "other");
  EXPECT_EQ((*recorded)->Repeats("cup", Command(0.001)), 3u);
  EXPECT_THAT((*recorded)->objects(), ElementsAre("cup", "mug"));
  EXPECT_EQ((*recorded)->FindId("b")->id, "b");
  EXPECT_EQ((*recorded)->FindId("failed"), nullptr);
}

TEST_F(RecordedTouchesTest, WhatWasNeverRecordedIsNotGiven) {
  Session("s");
  Add("s", "a", "cup", Command(0.001));
  const auto recorded = RecordedTouches::Read(*journal_);
  ASSERT_TRUE(recorded.ok()) << recorded.status();
  EXPECT_EQ((*recorded)->Find("cup", Command(0.002)), nullptr);
  EXPECT_EQ((*recorded)->Find("cup", Command(0.001, 0.03)), nullptr);
  EXPECT_EQ((*recorded)->Find("bowl", Command(0.001)), nullptr);
  v1::CommandedTouch limited = Command(0.001);
  limited.set_stroke_m(0);
  EXPECT_EQ((*recorded)->Find("cup", limited), nullptr);
}

TEST_F(RecordedTouchesTest, RoundingAndConditionsMakeNoOtherTouch) {
  Session("s");
  Add("s", "a", "cup", Command(0.003));  // on the border of a cell
  const auto recorded = RecordedTouches::Read(*journal_);
  ASSERT_TRUE(recorded.ok()) << recorded.status();
  for (const double delta_m : {-9e-10, 9e-10})
    EXPECT_NE((*recorded)->Find("cup", Command(0.003 + delta_m)), nullptr) << delta_m;
  EXPECT_EQ((*recorded)->Find("cup", Command(0.003 + 2e-9)), nullptr);
  v1::CommandedTouch later = Command(0.003);
  later.set_session_time_s(100);
  (*later.mutable_covariates())["cov_temperature"] = 21;
  EXPECT_NE((*recorded)->Find("cup", later), nullptr);
}

TEST_F(RecordedTouchesTest, TheSameBytesComeBeforeSimilarOnes) {
  Session("s");
  v1::CommandedTouch warm = Command(0.001);
  (*warm.mutable_covariates())["cov_temperature"] = 30;
  Add("s", "cold", "cup", Command(0.001));
  Add("s", "warm", "cup", warm);
  const auto recorded = RecordedTouches::Read(*journal_);
  ASSERT_TRUE(recorded.ok()) << recorded.status();
  EXPECT_EQ((*recorded)->Find("cup", warm)->id, "warm");
  EXPECT_EQ((*recorded)->Find("cup", CommandBytes(warm), 1)->id, "warm");
}

TEST_F(RecordedTouchesTest, SessionsOfOneEndEffectorAreServedTogether) {
  Session("s");
  Session("t");
  Session("u", 2);
  Add("s", "a", "cup", Command(0.001));
  Add("t", "a", "cup", Command(0.001));
  const auto both = RecordedTouches::Read(*journal_, {"s", "t"});
  ASSERT_TRUE(both.ok()) << both.status();
  EXPECT_EQ((*both)->touches().size(), 2u);
  const absl::Status mixed = RecordedTouches::Read(*journal_).status();
  EXPECT_TRUE(absl::IsInvalidArgument(mixed));
  EXPECT_THAT(std::string(mixed.message()), HasSubstr("session 'u' has 2 fingers"));
  EXPECT_TRUE(absl::IsNotFound(RecordedTouches::Read(*journal_, {"v"}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(RecordedTouches::Read(*journal_, {"u"}).status()));
}

}  // namespace
}  // namespace touchstone::session
