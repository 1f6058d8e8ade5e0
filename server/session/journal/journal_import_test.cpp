// Sessions that are added as a whole, and files that stand in a journal's way.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"
#include "server/session/journal/journal.h"

namespace touchstone::session {
namespace {

using ::testing::HasSubstr;
using Mode = Journal::Mode;

SessionContent OneTouch(const std::string& name) {
  SessionContent content;
  content.session.name = name;
  JournalTouch& touch = content.touches.emplace_back();
  touch.id = "t", touch.object = "cup", touch.stage = TouchStage::kDone;
  touch.result.fingers.resize(3);
  return content;
}

TEST(JournalImport, ASessionIsAddedWithAllThatItHasOrNotAtAll) {
  const TestFolder folder;
  const auto journal = Journal::Open(folder.Path("s.db"), Mode::kCreateOrReadWrite).value();
  SessionContent content = OneTouch("s");
  for (const char* id : {"front", "front"}) content.images.emplace_back().id = id;
  EXPECT_TRUE(absl::IsAlreadyExists(journal->AddSession(content))) << "two pictures of one id";
  EXPECT_FALSE(*journal->HasSession("s"));
  content.images[1].id = "back";
  ASSERT_TRUE(journal->AddSession(content).ok());
  EXPECT_EQ(journal->Session("s")->done, 1u);
  EXPECT_EQ(journal->Session("s")->images, 2u);
  EXPECT_TRUE(absl::IsAlreadyExists(journal->AddSession(content)));
}

TEST(JournalImport, NothingIsWrittenThroughALockThatIsALink) {
  const TestFolder folder;
  const std::string kept = folder.Path("of another"), lock = folder.Path("s.db.lock");
  std::ofstream(kept) << "kept";
  std::filesystem::create_symlink(kept, lock);
  absl::Status status = Journal::Open(folder.Path("s.db"), Mode::kCreateOrReadWrite).status();
  EXPECT_TRUE(absl::IsPermissionDenied(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("s.db.lock is a link"));
  std::filesystem::remove(lock);
  std::filesystem::create_hard_link(kept, lock);
  status = Journal::Open(folder.Path("s.db"), Mode::kCreateOrReadWrite).status();
  EXPECT_TRUE(absl::IsPermissionDenied(status)) << status;
  EXPECT_EQ(ReadFile(kept).value(), "kept");
  EXPECT_FALSE(std::filesystem::exists(folder.Path("s.db")));
}

TEST(JournalImport, AValueThatNoMemoryShouldBeTakenForIsRefusedAndLeftOutAsDamage) {
  const TestFolder folder;
  const std::string path = folder.Path("s.db");
  SessionContent content = OneTouch("s");
  content.images.emplace_back().id = "large";
  content.images[0].png = std::string((64 << 20) + 1, 'x');
  {
    const auto journal = Journal::Open(path, Mode::kCreateOrReadWrite).value();
    const absl::Status refused = journal->AddSession(content);
    EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
    EXPECT_THAT(std::string(refused.message()), HasSubstr("holds values of at most 64 MiB"));
    content.images[0].png = "x";
    ASSERT_TRUE(journal->AddSession(content).ok());
  }
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  // Zeros that take no room until they are read.
  EXPECT_EQ(sqlite3_exec(database, "UPDATE image SET png = zeroblob(100000000)", nullptr, nullptr, nullptr),
            SQLITE_OK);
  sqlite3_close(database);
  const auto read = [&](Journal::SkipDamaged skip) {
    const auto journal = Journal::Open(path, Mode::kReadOnly, std::move(skip)).value();
    return journal->ForEachImage("s", [](const JournalImage&) { return true; });
  };
  EXPECT_TRUE(absl::IsDataLoss(read(nullptr))) << read(nullptr);
  int damaged = 0;
  EXPECT_TRUE(read([&](const absl::Status&) { ++damaged; }).ok());
  EXPECT_GE(damaged, 1);
}

}  // namespace
}  // namespace touchstone::session
