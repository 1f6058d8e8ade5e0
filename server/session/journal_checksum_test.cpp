// A journal whose bytes have changed on the disk: every outcome is an error that names it, or the data as they were.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "server/base/numbers/nan.h"
#include "server/base/test_folder.h"
#include "server/base/test_tier.h"
#include "server/base/text/text.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/journal/journal.h"
#include "server/session/session_files.h"

namespace touchstone::session {
namespace {

using ::testing::HasSubstr;
using Mode = Journal::Mode;

std::string MessageOf(const absl::Status& status) {
  return std::string(status.message());
}

class JournalChecksum : public ::testing::Test {
 protected:
  JournalChecksum() { path_ = folder_ + "/session.db"; }

  static JournalSession Head() {
    JournalSession session;
    session.name = "s";
    session.created_unix_s = 1.7e9;
    session.provenance = "emulated rig";
    session.calibration = "touchstone: calibration/1\n";
    return session;
  }

  static std::string Command(int k) {
    v1::CommandedTouch command;
    command.mutable_target_m()->set_x(0.001 * k);
    command.mutable_approach()->set_z(-1);
    command.mutable_lateral()->set_x(1);
    command.set_standoff_m(0.01);
    command.set_speed_m_s(0.02);
    return CommandBytes(command);
  }

  static JournalResult ResultOf(int k) {
    JournalResult result;
    for (int i = 0; i < 3; ++i) {
      JournalFinger& finger = result.fingers.emplace_back();
      finger.contact_time_s = 3.625 + 0.001 * k + 0.01 * i;
      finger.base_from_tip = {0.3, 0.1, 0.2 + 0.001 * k, 3.1, 0, 0.01 * i};
      finger.ticks = 1000 * k + i;
    }
    result.speed_m_s = 0.0199;
    result.session_time_s = 12.5 * k;
    result.start_unix_s = 1.7e9 + 12.5 * k;
    result.time_uncertainty_s = 1e-6;
    return result;
  }

  // A journal with so many touches and two pictures, closed.
  void Make(int touches) {
    auto journal = Journal::Open(path_, Mode::kCreateOrReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    ASSERT_TRUE((*journal)->EnsureSession(Head()).ok());
    for (int k = 0; k < touches; ++k) {
      const std::string id = "t" + std::to_string(k);
      ASSERT_TRUE(
          (*journal)->BeginExecuting("s", id, k % 2 == 0 ? "cup" : "mug", "+z", Command(k), k + 1, 7).ok());
      if (k % 10 == 9) {
        ASSERT_TRUE((*journal)->Failed("s", id, "the arm was stopped").ok());
        continue;
      }
      const JournalSeries series{"raw", std::string(200, static_cast<char>(k))};
      ASSERT_TRUE((*journal)->Done("s", id, ResultOf(k), k == 4 ? &series : nullptr).ok());
    }
    for (int k = 0; k < 2; ++k) {
      JournalImage image;
      image.object = "cup";
      image.width = image.height = 10;
      image.png = std::string(5000, static_cast<char>('p' + k));
      ASSERT_TRUE((*journal)->AddImage("s", image).ok());
    }
    ASSERT_TRUE((*journal)->SetMetadata("mounted_object", "cup").ok());
  }

  void Sql(const std::string& sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  // Everything that an export could hold, as text.
  static absl::StatusOr<std::string> Everything(const std::string& path,
                                                Journal::SkipDamaged skip = nullptr) {
    auto journal = Journal::Open(path, Mode::kReadOnly, std::move(skip));
    if (!journal.ok()) return journal.status();
    auto sessions = (*journal)->Sessions();
    if (!sessions.ok()) return sessions.status();
    std::string text;
    for (const JournalSession& session : *sessions) {
      text += session.name + "|" + session.provenance + "|" + session.calibration + "|" +
              std::to_string(session.fingers) + "|" + ShortestNumber(session.spacing_m) + "|" +
              ShortestNumber(session.created_unix_s) + "|" + std::to_string(session.touches) + "|" +
              std::to_string(session.done) + "|" + std::to_string(session.failed) + "|" +
              std::to_string(session.images);
      for (const std::string& object : session.objects) text += "|" + object;
      std::vector<std::string> with_series;
      absl::Status status = (*journal)->ForEachTouch(session.name, [&](const JournalTouch& touch) {
        text += "\n" + touch.id + "|" + std::to_string(touch.number) + "|" + touch.object + "|" +
                touch.up_face + "|" + std::to_string(static_cast<int>(touch.stage)) + "|" + touch.error +
                "|" + touch.command + "|" + std::to_string(touch.attempt) + "|" +
                std::to_string(touch.program_id) + "|" + std::to_string(touch.boot_id) + "|" +
                ShortestNumber(touch.result.speed_m_s) + "|" + ShortestNumber(touch.result.session_time_s) +
                "|" + ShortestNumber(touch.result.start_unix_s) + "|" +
                ShortestNumber(touch.result.time_uncertainty_s) + "|" +
                std::to_string(touch.result.recovered);
        for (const JournalFinger& finger : touch.result.fingers) {
          text += "|" + ShortestNumber(finger.contact_time_s) + "|" + std::to_string(finger.ticks);
          for (const double each : finger.base_from_tip) text += "|" + ShortestNumber(each);
        }
        with_series.push_back(touch.id);
        return true;
      });
      if (!status.ok()) return status;
      for (const std::string& id : with_series) {
        const auto series = (*journal)->Series(session.name, id);
        if (!series.ok()) return series.status();
        if (series->has_value()) text += "\n" + id + "|" + (*series)->encoding + "|" + (*series)->columns;
      }
      status = (*journal)->ForEachImage(session.name, [&](const JournalImage& image) {
        text += "\n" + image.id + "|" + image.object + "|" + image.png;
        for (const double each : image.base_from_camera) text += "|" + ShortestNumber(each);
        return true;
      });
      if (!status.ok()) return status;
    }
    const auto mounted = (*journal)->Metadata("mounted_object");
    if (!mounted.ok()) return mounted.status();
    const auto stop = (*journal)->Metadata("stop");
    if (!stop.ok()) return stop.status();
    return text + "\n" + *mounted + "|" + *stop;
  }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
  std::string path_;
};

TEST_F(JournalChecksum, AFlippedBitGivesAnErrorThatNamesTheFileOrTheSameData) {
  TOUCHSTONE_SECOND_TIER("repeated: every byte of a journal");
  Make(60);
  const auto whole = Everything(path_);
  ASSERT_TRUE(whole.ok()) << whole.status();
  const auto bytes = ReadFile(path_);
  ASSERT_TRUE(bytes.ok());
  const std::string damaged_path = folder_ + "/damaged.db";
  std::mt19937 random(20260131);
  int errors = 0, by_checksum = 0;
  constexpr int kRuns = 1500;
  for (int run = 0; run < kRuns; ++run) {
    // One bit, or a few, or bytes of a torn sector.
    std::string damaged = *bytes;
    const int bits = run % 3 == 0 ? 8 : 1;
    for (int i = 0; i < bits; ++i) {
      const size_t place = std::uniform_int_distribution<size_t>(0, damaged.size() - 1)(random);
      damaged[place] = static_cast<char>(damaged[place] ^ (1 << (random() % 8)));
    }
    std::ofstream(damaged_path, std::ios::binary) << damaged;
    const auto read = Everything(damaged_path);
    if (read.ok()) {
      ASSERT_EQ(*read, *whole) << "run " << run << ": other data without an error";
      continue;
    }
    ++errors;
    by_checksum += MessageOf(read.status()).find("checksum") != std::string::npos;
    ASSERT_THAT(MessageOf(read.status()), HasSubstr(damaged_path)) << "run " << run;
  }
  // The test can fail: most damage is met, and much of it by nothing but a checksum.
  EXPECT_GT(errors, kRuns / 4);
  EXPECT_GT(by_checksum, kRuns / 20);
  std::cout << errors << " of " << kRuns << " damaged journals were refused, " << by_checksum
            << " of them by a checksum; the others gave the same data\n";
}

TEST_F(JournalChecksum, AChangedContactTimeIsFoundByEveryReaderWithTheTouchsNumber) {
  Make(12);
  Sql("UPDATE touch_finger SET contact_time_s = contact_time_s - 1 WHERE finger = 1 AND touch_id = "
      "(SELECT touch_id FROM touch WHERE number = 5)");
  auto journal = Journal::Open(path_, Mode::kReadWrite);
  ASSERT_TRUE(journal.ok()) << "one damaged touch does not keep a rig from working: " << journal.status();
  const char* const expected = "touch 5 ('t5') of session 's' is damaged";
  EXPECT_THAT(MessageOf((*journal)->Find("s", "t5").status()), HasSubstr(expected));
  EXPECT_THAT(MessageOf((*journal)->Find("s", "t5").status()), HasSubstr("--skip-damaged"));
  EXPECT_TRUE((*journal)->Find("s", "t4").ok());
  EXPECT_THAT(MessageOf((*journal)->Begin("s", "t5", "mug", "+z", Command(5)).status()), HasSubstr(expected));
  EXPECT_THAT(MessageOf(ExportSessionCsv(**journal, "s", folder_ + "/out.csv")), HasSubstr(expected));
  EXPECT_THAT(MessageOf(ExportSessionHdf5(**journal, "s", folder_ + "/out.h5")), HasSubstr(expected));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/out.csv"));
  auto other = Journal::Open(folder_ + "/other.db", Mode::kCreateOrReadWrite);
  ASSERT_TRUE(other.ok());
  EXPECT_THAT(MessageOf((*journal)->CopySession("s", other->get())), HasSubstr(expected));
  EXPECT_TRUE((*other)->Sessions()->empty());
}

TEST_F(JournalChecksum, DamageIsLeftOutOnRequestOnlyAndThenSaid) {
  Make(12);
  Sql("UPDATE touch SET session_time_s = 3600 WHERE number = 5; DELETE FROM touch WHERE number = 7;");
  EXPECT_TRUE(absl::IsDataLoss(Everything(path_).status()));
  std::vector<std::string> said;
  auto journal = Journal::Open(path_, Mode::kReadOnly,
                               [&](const absl::Status& damage) { said.push_back(MessageOf(damage)); });
  ASSERT_TRUE(journal.ok()) << journal.status();
  std::vector<uint64_t> numbers;
  ASSERT_TRUE((*journal)
                  ->ForEachTouch("s",
                                 [&](const JournalTouch& touch) {
                                   numbers.push_back(touch.number);
                                   return true;
                                 })
                  .ok());
  EXPECT_THAT(numbers, ::testing::ElementsAre(0, 1, 2, 3, 4, 6, 8, 9, 10, 11));
  ASSERT_EQ(said.size(), 2u);
  EXPECT_THAT(said[0], HasSubstr("11 of its 12 touches are found"));
  EXPECT_THAT(said[1], HasSubstr("touch 5 ('t5')"));
  EXPECT_TRUE(
      absl::IsInvalidArgument(Journal::Open(path_, Mode::kReadWrite, [](const absl::Status&) {}).status()));
}

TEST_F(JournalChecksum, WhatIsWholeOfAFileWithATornPageIsExportedOnRequest) {
  Make(300);
  const auto size = std::filesystem::file_size(path_);
  {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(size / 2 / 4096 * 4096));
    file << std::string(4096, '\xA5');
  }
  EXPECT_TRUE(absl::IsDataLoss(Everything(path_).status()));
  int said = 0;
  auto journal = Journal::Open(path_, Mode::kReadOnly, [&](const absl::Status&) { ++said; });
  ASSERT_TRUE(journal.ok()) << journal.status();
  size_t whole = 0;
  const absl::Status read = (*journal)->ForEachTouch("s", [&](const JournalTouch&) { return ++whole > 0; });
  EXPECT_TRUE(read.ok()) << read;
  EXPECT_GT(said, 0);
  EXPECT_GT(whole, 100u);
  EXPECT_LT(whole, 300u);
  EXPECT_TRUE((*journal)->Sessions().ok());
}

TEST_F(JournalChecksum, RowsThatVanishOrAreExchangedAreMissed) {
  const struct {
    const char* sql;
    const char* expected;
  } cases[] = {
      {"DELETE FROM touch_finger WHERE touch_id = 3 AND finger = 2", "touch 2 ('t2')"},
      {"UPDATE touch_finger SET finger = 9 WHERE touch_id = 3 AND finger = 2", "touch 2 ('t2')"},
      {"UPDATE touch_finger SET touch_id = -touch_id WHERE touch_id IN (6, 7) AND finger = 1;"
       "UPDATE touch_finger SET touch_id = 13 + touch_id WHERE touch_id < 0",
       "touch "},
      {"DELETE FROM touch WHERE number = 11", "11 of its 12 touches"},
      {"DELETE FROM image WHERE number = 1", "1 of its 2 pictures"},
      {"UPDATE touch SET number = 99 WHERE number = 4", "touch 99 ('t4')"},
      {"UPDATE session SET fingers = 2", "the head of session 's'"},
      {"UPDATE session_object SET name = 'pot' WHERE name = 'mug'", "the head of session 's'"},
      {"UPDATE session_tally SET done = done + 1", "the counts of session 's'"},
      {"DELETE FROM session_tally", "the counts of session 's'"},
      {"DELETE FROM session", "0 of its 1 sessions"},
      {"DELETE FROM head", "table head"},
      {"UPDATE fact SET value = 'pot'", "'mounted_object' is damaged"},
      {"DELETE FROM fact", "one of its facts is damaged or lost"},
      {"DELETE FROM touch_series", "time series of touch 4 ('t4') is lost"},
      {"UPDATE touch_series SET columns = x'00'", "time series of touch 4 ('t4') is damaged"},
      {"UPDATE touch SET target_x_m = 7 WHERE number = 1", "touch 1 ('t1')"},
  };
  for (const auto& each : cases) {
    std::filesystem::remove(path_);
    Make(12);
    Sql(each.sql);
    const auto read = Everything(path_);
    EXPECT_TRUE(absl::IsDataLoss(read.status())) << each.sql << ": " << read.status();
    EXPECT_THAT(MessageOf(read.status()), HasSubstr(each.expected)) << each.sql;
  }
}

TEST_F(JournalChecksum, DamageIsNotSealedByWhatIsWrittenLater) {
  Make(12);
  {
    auto journal = Journal::Open(path_, Mode::kReadWrite);
    ASSERT_TRUE((*journal)->BeginExecuting("s", "new", "cup", "+z", Command(50), 50, 7).ok());
  }
  Sql("UPDATE touch SET object = 'pot' WHERE id = 'new'; UPDATE touch SET object = 'pot' WHERE number = 2");
  auto journal = Journal::Open(path_, Mode::kReadWrite);
  ASSERT_TRUE(journal.ok()) << journal.status();
  EXPECT_THAT(MessageOf((*journal)->Done("s", "new", ResultOf(50))), HasSubstr("touch 12 ('new')"));
  ASSERT_TRUE((*journal)->BeginExecuting("s", "newer", "cup", "+z", Command(51), 51, 7).ok());
  ASSERT_TRUE((*journal)->Done("s", "newer", ResultOf(51)).ok());
  EXPECT_THAT(MessageOf((*journal)->Find("s", "t2").status()), HasSubstr("touch 2 ('t2')"));
}

}  // namespace
}  // namespace touchstone::session
