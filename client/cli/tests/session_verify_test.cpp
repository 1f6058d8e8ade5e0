// touchstone session verify on journals; those of a server are in server_variable_test.cpp.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/journal/journal.h"

namespace touchstone::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class SessionVerifyTest : public RealBinaryTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(Run({"plan", "lat20", "--count", "4", "-o", "plan.csv"}).exit_code, 0);
    ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "-o", "set.csv"}).exit_code, 0);
    ASSERT_EQ(Run({"session", "import", "set.csv", "-o", "session.db"}).exit_code, 0);
  }
};

TEST_F(SessionVerifyTest, AWholeJournalIsSaidToBe) {
  const Outcome outcome = Run({"session", "verify", "session.db"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("session 'set' is whole: 4 touches, 0 pictures"));
  const auto json = nlohmann::json::parse(Run({"session", "verify", "session.db", "set", "--json"}).out);
  EXPECT_EQ(json["whole"], true);
  EXPECT_EQ(json["touches"], 4);
}

TEST_F(SessionVerifyTest, AChangedTouchIsNamedAndTheOthersCounted) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(Path("session.db").c_str(), &database), SQLITE_OK);
  char* error = nullptr;
  ASSERT_EQ(
      sqlite3_exec(
          database,
          "UPDATE touch_finger SET contact_time_s = contact_time_s + 1 WHERE touch_id = 2 AND finger = 0",
          nullptr, nullptr, &error),
      SQLITE_OK)
      << error;
  sqlite3_close(database);
  const Outcome outcome = Run({"session", "verify", "session.db"});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("is not whole: 3 touches"), HasSubstr("differs from its checksum"),
                                 HasSubstr("touchstone recover session.db")));
}

TEST_F(SessionVerifyTest, ATouchThatAKillLeftUnderWayIsCountedAsInTheList) {
  {
    const auto journal =
        session::Journal::Open(Path("session.db"), session::Journal::Mode::kCreateOrReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    ASSERT_TRUE(
        (*journal)->Begin("set", "killed", "lat20", "+z", session::CommandBytes(v1::CommandedTouch())).ok());
  }
  const auto listed =
      nlohmann::json::parse(Run({"session", "list", "session.db", "--json"}).out)["sessions"][0];
  const Outcome verified = Run({"session", "verify", "session.db", "--json"});
  const auto read = nlohmann::json::parse(verified.out);
  for (const auto& counts : {listed, read}) {
    EXPECT_EQ(counts["touches"], 5);
    EXPECT_EQ(counts["done"], 4);
  }
  EXPECT_THAT(verified.err, HasSubstr("is whole: 5 touches (4 of them done)"));
}

// What is said to be typed is what works.
TEST_F(SessionVerifyTest, OfSeveralSessionsACommandThatNamesOneIsSaid) {
  ASSERT_EQ(Run({"session", "import", "set.csv", "-o", "session.db", "--session", "tuesday"}).exit_code, 0);
  for (const std::string command : {"verify", "show", "export"}) {
    const Outcome outcome = Run({"session", command, "session.db"});
    EXPECT_EQ(outcome.exit_code, 2) << command;
    EXPECT_THAT(outcome.err,
                HasSubstr(absl::StrCat("session.db: the journal has 2 sessions (set, tuesday); say "
                                       "which: touchstone session ",
                                       command, " session.db set")));
    EXPECT_EQ(Run({"session", command, "session.db", "set"}).exit_code, 0) << command;
  }
}

TEST_F(SessionVerifyTest, WithoutAServerANameSaysWhatIsMissing) {
  const Outcome outcome = Run({"session", "verify", "monday"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("'monday'"), HasSubstr("--server"), HasSubstr("touchstone verify")));
}

}  // namespace
}  // namespace touchstone::cli
