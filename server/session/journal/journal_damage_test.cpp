// What a journal does when it is killed, damaged, full, or opened by two.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <random>
#include <thread>

#include "server/base/test_folder.h"
#include "server/base/test_tier.h"
#include "server/session/journal/journal.h"

namespace touchstone::session {
namespace {

using ::testing::HasSubstr;
using Mode = Journal::Mode;

class JournalDamage : public ::testing::Test {
 protected:
  JournalDamage() { path_ = folder_ + "/session.db"; }

  static JournalSession Session() {
    JournalSession session;
    session.name = "s";
    session.fingers = 1;
    return session;
  }

  static JournalResult ResultOf(double time_s) {
    JournalResult result;
    result.fingers.resize(1);
    result.fingers[0].contact_time_s = time_s;
    return result;
  }

  // A journal with so many touches that are done, closed.
  void Make(int touches) {
    auto journal = Journal::Open(path_, Mode::kCreateOrReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    ASSERT_TRUE((*journal)->EnsureSession(Session()).ok());
    std::vector<JournalTouch> all(touches);
    for (int i = 0; i < touches; ++i) {
      all[i].id = std::to_string(i);
      all[i].object = "cup";
      all[i].command = std::string(100, 'c');
      all[i].stage = TouchStage::kDone;
      all[i].result = ResultOf(i);
    }
    ASSERT_TRUE((*journal)->AddFinished("s", all).ok());
  }

  void Sql(const char* sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  absl::Status Opened(Mode mode) { return Journal::Open(path_, mode).status(); }
  static std::string Message(const absl::Status& status) { return std::string(status.message()); }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
  std::string path_;
};

// The child's part: touches one after the other; a byte down the pipe after every step that was acknowledged.
[[noreturn]] void WriteUntilKilled(const std::string& path, int round, int pipe) {
  auto journal = Journal::Open(path, Mode::kCreateOrReadWrite);
  if (!journal.ok()) _exit(1);
  JournalSession session;
  session.name = "s";
  session.fingers = 1;
  if (!(*journal)->EnsureSession(session).ok()) _exit(2);
  const auto tell = [pipe] { return write(pipe, "+", 1) == 1; };
  for (int i = 0;; ++i) {
    const std::string id = std::to_string(round) + "-" + std::to_string(i);
    JournalResult result;
    result.fingers.resize(1);
    result.fingers[0].contact_time_s = i;
    if (!(*journal)->Begin("s", id, "cup", "+z", id).ok() || !tell()) _exit(3);
    if (!(*journal)->Executing("s", id, i + 1, round).ok() || !tell()) _exit(4);
    if (!(*journal)->Done("s", id, result).ok() || !tell()) _exit(5);
  }
}

TEST_F(JournalDamage, NothingAcknowledgedIsLostOrDoubledByKillsAtRandomMoments) {
  TOUCHSTONE_SECOND_TIER("repeated: kills at many moments");
  std::mt19937 random(20260131);
  std::map<std::string, TouchStage> acknowledged;  // the least that each touch must have reached
  int interrupted = 0;
  for (int round = 0; round < 25; ++round) {
    int ends[2];
    ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) WriteUntilKilled(path_, round, ends[1]);
    close(ends[1]);
    // Killed somewhere within a step: after so many acknowledgements and a little while.
    const int steps = std::uniform_int_distribution<int>(1, 30)(random);
    char sign = 0;
    int heard = 0;
    while (heard < steps && read(ends[0], &sign, 1) == 1) ++heard;
    ASSERT_EQ(heard, steps) << "the child ended by itself";
    std::this_thread::sleep_for(
        std::chrono::microseconds(std::uniform_int_distribution<int>(0, 3000)(random)));
    kill(child, SIGKILL);
    while (read(ends[0], &sign, 1) == 1) ++heard;
    close(ends[0]);
    int how = 0;
    ASSERT_EQ(waitpid(child, &how, 0), child);
    ASSERT_TRUE(WIFSIGNALED(how));
    for (int step = 0; step < heard; ++step)
      acknowledged[std::to_string(round) + "-" + std::to_string(step / 3)] =
          static_cast<TouchStage>(step % 3 + 1);

    auto journal = Journal::Open(path_, Mode::kReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    std::map<std::string, TouchStage> kept;
    uint64_t next = 0;
    ASSERT_TRUE((*journal)
                    ->ForEachTouch("s",
                                   [&](const JournalTouch& touch) {
                                     EXPECT_TRUE(kept.emplace(touch.id, touch.stage).second)
                                         << touch.id << " stands twice";
                                     EXPECT_EQ(touch.number, next++);
                                     if (touch.stage == TouchStage::kDone) {
                                       EXPECT_EQ("-" + std::to_string(static_cast<int>(
                                                           touch.result.fingers.at(0).contact_time_s)),
                                                 touch.id.substr(touch.id.find('-')));
                                     }
                                     return true;
                                   })
                    .ok());
    // At most one step more than was acknowledged: the one that was under way.
    int ahead = 0;
    for (const auto& [id, stage] : acknowledged) {
      ASSERT_EQ(kept.count(id), 1u) << id << " is lost";
      ASSERT_GE(kept[id], stage) << id;
      ahead += static_cast<int>(kept[id]) - static_cast<int>(stage);
    }
    ahead += static_cast<int>(kept.size() - acknowledged.size());
    ASSERT_LE(ahead, 1);
    // What was under way, and nothing else, is unfinished; it is reconciled and stays so.
    const auto unfinished = (*journal)->Unfinished();
    ASSERT_TRUE(unfinished.ok()) << unfinished.status();
    ASSERT_LE(unfinished->size(), 1u);
    for (const auto& [session, touch] : *unfinished) {
      ++interrupted;
      if (touch.stage == TouchStage::kExecuting) {
        EXPECT_EQ(touch.boot_id, static_cast<uint32_t>(round));
      }
      ASSERT_TRUE((*journal)->Failed(session, touch.id, "interrupted").ok());
      kept[touch.id] = TouchStage::kFailed;
    }
    acknowledged = kept;
  }
  EXPECT_GT(interrupted, 0);
}

TEST_F(JournalDamage, AMissingFileIsToldFromAnEmptyOne) {
  EXPECT_TRUE(absl::IsNotFound(Opened(Mode::kReadWrite)));
  EXPECT_TRUE(absl::IsNotFound(Opened(Mode::kReadOnly)));
  EXPECT_THAT(Message(Opened(Mode::kReadOnly)), HasSubstr(path_ + ": there is no such file"));
  std::ofstream file(path_);
  file.close();
  EXPECT_THAT(Message(Opened(Mode::kReadOnly)), HasSubstr("is empty"));
  EXPECT_THAT(Message(Opened(Mode::kReadWrite)), HasSubstr("is empty"));
  EXPECT_TRUE(Opened(Mode::kCreateOrReadWrite).ok());
  EXPECT_TRUE(Opened(Mode::kReadOnly).ok());
  EXPECT_FALSE(Journal::Open(folder_, Mode::kReadWrite).ok());
  EXPECT_FALSE(Journal::Open(folder_ + "/no/session.db", Mode::kCreateOrReadWrite).ok());
  EXPECT_FALSE(Journal::Open("", Mode::kCreateOrReadWrite).ok());
}

TEST_F(JournalDamage, OtherFilesAreNoJournalsAndStayAsTheyAre) {
  const std::string text(5000, 'x');
  std::ofstream(path_) << text;
  for (const Mode mode : {Mode::kReadOnly, Mode::kReadWrite, Mode::kCreateOrReadWrite}) {
    EXPECT_TRUE(absl::IsInvalidArgument(Opened(mode))) << Opened(mode);
    EXPECT_THAT(Message(Opened(mode)), HasSubstr("is no journal"));
  }
  std::ifstream file(path_);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(file), {}), text);
  std::filesystem::remove(path_);
  Sql("CREATE TABLE cake(layers)");
  EXPECT_THAT(Message(Opened(Mode::kCreateOrReadWrite)), HasSubstr("another program's SQLite file"));
  EXPECT_TRUE(absl::IsInvalidArgument(Opened(Mode::kReadOnly)));
}

TEST_F(JournalDamage, AnotherVersionIsNamed) {
  Make(1);
  Sql("PRAGMA user_version = 4");
  const absl::Status status = Opened(Mode::kReadWrite);
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_THAT(Message(status),
              HasSubstr("is of version 4; this program reads versions 1 to 3: use the newer program"));
}

TEST_F(JournalDamage, ADamagedFileIsNotWrittenTo) {
  Make(500);
  const auto size = std::filesystem::file_size(path_);
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(size / 2));
  file << std::string(20000, '\xA5');
  file.close();
  const absl::Status status = Opened(Mode::kReadWrite);
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(Message(status), HasSubstr(".recover"));
  std::filesystem::resize_file(path_, size / 2);
  EXPECT_TRUE(absl::IsDataLoss(Opened(Mode::kReadWrite))) << Opened(Mode::kReadWrite);
}

TEST_F(JournalDamage, OneWriterAJournalAndAnyReaders) {
  Make(1);
  auto writer = Journal::Open(path_, Mode::kReadWrite);
  ASSERT_TRUE(writer.ok()) << writer.status();
  const absl::Status second = Opened(Mode::kReadWrite);
  EXPECT_TRUE(absl::IsFailedPrecondition(second)) << second;
  EXPECT_THAT(Message(second), HasSubstr("is open for writing by process " + std::to_string(getpid())));
  auto reader = Journal::Open(path_, Mode::kReadOnly);
  ASSERT_TRUE(reader.ok()) << reader.status();
  ASSERT_TRUE((*writer)->Begin("s", "new", "cup", "+z", "1").ok());
  EXPECT_EQ((*reader)->Session("s")->touches, 2u);
  *writer = nullptr;
  EXPECT_TRUE(Opened(Mode::kReadWrite).ok());
}

TEST_F(JournalDamage, AReaderWritesNothing) {
  Make(1);
  auto reader = Journal::Open(path_, Mode::kReadOnly);
  ASSERT_TRUE(reader.ok()) << reader.status();
  const absl::Status status = (*reader)->Begin("s", "new", "cup", "+z", "1").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_THAT(Message(status), HasSubstr("was opened for reading only"));
  EXPECT_TRUE(absl::IsFailedPrecondition((*reader)->SetMetadata("a", "b")));
  EXPECT_TRUE(absl::IsFailedPrecondition((*reader)->DeleteSession("s", "ana")));
  EXPECT_EQ((*reader)->Session("s")->touches, 1u);
}

TEST_F(JournalDamage, AFullDiskRefusesTheStepAndKeepsTheRest) {
  Make(10);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // A file that may not grow further fails as a full disk does.
    signal(SIGXFSZ, SIG_IGN);
    auto journal = Journal::Open(path_, Mode::kReadWrite);
    if (!journal.ok()) _exit(1);
    struct rlimit limit {};
    limit.rlim_cur = limit.rlim_max = 200'000;
    if (setrlimit(RLIMIT_FSIZE, &limit) != 0) _exit(2);
    int acknowledged = 0;
    for (; acknowledged < 10000; ++acknowledged) {
      const std::string id = "new-" + std::to_string(acknowledged);
      const absl::Status status = (*journal)->Begin("s", id, "cup", "+z", std::string(2000, 'c')).status();
      if (status.ok()) continue;
      if (!absl::IsResourceExhausted(status)) {
        std::cerr << status << '\n';
        _exit(3);
      }
      if (status.message().find("make room") == absl::string_view::npos) _exit(4);
      break;
    }
    // What can be read still is, and the count is handed on.
    if (!(*journal)->Find("s", "0").ok()) _exit(5);
    std::ofstream(folder_ + "/acknowledged") << acknowledged;
    _exit(0);
  }
  int how = 0;
  ASSERT_EQ(waitpid(child, &how, 0), child);
  ASSERT_TRUE(WIFEXITED(how));
  ASSERT_EQ(WEXITSTATUS(how), 0);
  uint64_t acknowledged = 0;
  std::ifstream(folder_ + "/acknowledged") >> acknowledged;
  EXPECT_GT(acknowledged, 0u);
  EXPECT_LT(acknowledged, 10000u);
  auto journal = Journal::Open(path_, Mode::kReadWrite);
  ASSERT_TRUE(journal.ok()) << journal.status();
  EXPECT_EQ((*journal)->Session("s")->touches, 10 + acknowledged);
  EXPECT_TRUE((*journal)->Begin("s", "after", "cup", "+z", "1").ok());
}

}  // namespace
}  // namespace touchstone::session
