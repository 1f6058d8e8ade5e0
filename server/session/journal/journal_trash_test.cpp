// Sessions that are deleted, come back, and end.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/test_folder.h"
#include "server/session/journal/journal.h"

namespace touchstone::session {
namespace {

using ::testing::HasSubstr;
using Mode = Journal::Mode;

class JournalTrash : public ::testing::Test {
 protected:
  JournalTrash() {
    journal_ = *Journal::Open(test_folder_.path() + "/session.db", Mode::kCreateOrReadWrite);
    Make("monday", 3);
  }

  void Make(const std::string& name, int touches) {
    JournalSession session;
    session.name = name;
    session.fingers = 1;
    ASSERT_TRUE(journal_->EnsureSession(session).ok());
    for (int k = 0; k < touches; ++k) {
      const std::string id = std::to_string(k);
      JournalResult result;
      result.fingers.resize(1);
      result.fingers[0].contact_time_s = touches + k;
      const JournalSeries series{"raw", "abc"};
      ASSERT_TRUE(journal_->BeginExecuting(name, id, "cup", "+z", id, k + 1, 1).ok());
      ASSERT_TRUE(journal_->Done(name, id, result, &series).ok());
    }
  }

  double FirstTimeS(const std::string& session) {
    return (*journal_->Find(session, "0"))->result.fingers.at(0).contact_time_s;
  }

  const TestFolder test_folder_;
  std::unique_ptr<Journal> journal_;
};

TEST_F(JournalTrash, ADeletedSessionComesBackAsItWas) {
  ASSERT_TRUE(journal_->DeleteSession("monday", "ana@lab").ok());
  EXPECT_TRUE(journal_->Sessions()->empty());
  EXPECT_FALSE(*journal_->HasSession("monday"));
  const auto deleted = journal_->DeletedSessions();
  ASSERT_TRUE(deleted.ok()) << deleted.status();
  ASSERT_EQ(deleted->size(), 1u);
  EXPECT_EQ((*deleted)[0].name, "monday");
  EXPECT_EQ((*deleted)[0].deleted_by, "ana@lab");
  EXPECT_GT((*deleted)[0].deleted_unix_s, 1.7e9);
  EXPECT_EQ((*deleted)[0].touches, 3u);
  ASSERT_TRUE(journal_->RestoreSession("monday").ok());
  EXPECT_EQ(journal_->Session("monday")->touches, 3u);
  EXPECT_EQ(journal_->Session("monday")->deleted_by, "");
  EXPECT_EQ(FirstTimeS("monday"), 3);
  EXPECT_TRUE((*journal_->Series("monday", "0")).has_value());
  EXPECT_TRUE(journal_->DeletedSessions()->empty());
}

TEST_F(JournalTrash, TheNameIsFreeAndTheLastDeletedComesBackFirst) {
  ASSERT_TRUE(journal_->DeleteSession("monday", "ana").ok());
  Make("monday", 5);
  const absl::Status twice = journal_->RestoreSession("monday");
  EXPECT_TRUE(absl::IsAlreadyExists(twice)) << twice;
  EXPECT_THAT(std::string(twice.message()), HasSubstr("delete that one too"));
  ASSERT_TRUE(journal_->DeleteSession("monday", "ben").ok());
  EXPECT_EQ(journal_->DeletedSessions()->size(), 2u);
  ASSERT_TRUE(journal_->RestoreSession("monday").ok());
  EXPECT_EQ(FirstTimeS("monday"), 5);
}

TEST_F(JournalTrash, OnlyWhatIsInTheTrashIsPurged) {
  const absl::Status live = journal_->PurgeSession("monday");
  EXPECT_TRUE(absl::IsNotFound(live)) << live;
  EXPECT_THAT(std::string(live.message()), HasSubstr("no session 'monday' in the trash"));
  EXPECT_TRUE(absl::IsNotFound(journal_->RestoreSession("monday")));
  ASSERT_TRUE(journal_->DeleteSession("monday", "ana").ok());
  Make("monday", 2);
  ASSERT_TRUE(journal_->PurgeSession("monday").ok());
  EXPECT_TRUE(journal_->DeletedSessions()->empty());
  EXPECT_EQ(journal_->Session("monday")->touches, 2u);
  EXPECT_EQ(FirstTimeS("monday"), 2);
  EXPECT_TRUE(absl::IsNotFound(journal_->PurgeSession("monday")));
}

TEST_F(JournalTrash, WhatIsExecutingIsNotDeleted) {
  ASSERT_TRUE(journal_->BeginExecuting("monday", "now", "cup", "+z", "now", 9, 1).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(journal_->DeleteSession("monday", "ana")));
  EXPECT_EQ(journal_->Session("monday")->touches, 4u);
}

}  // namespace
}  // namespace touchstone::session
