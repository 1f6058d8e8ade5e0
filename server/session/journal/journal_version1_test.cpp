// Journals that were written before their rows had checksums.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "server/base/test_folder.h"
#include "server/session/journal/journal.h"

namespace touchstone::session {
namespace {

using ::testing::HasSubstr;
using Mode = Journal::Mode;

constexpr char kVersion1[] = R"sql(
CREATE TABLE session(
  session_id INTEGER PRIMARY KEY,
  name TEXT NOT NULL UNIQUE,
  created_unix_s REAL NOT NULL,
  source TEXT NOT NULL,
  calibration TEXT NOT NULL,
  fingers INTEGER NOT NULL,
  spacing_m REAL NOT NULL);
CREATE TABLE session_object(
  session_id INTEGER NOT NULL REFERENCES session,
  position INTEGER NOT NULL,
  name TEXT NOT NULL,
  UNIQUE(session_id, name));
CREATE TABLE touch(
  touch_id INTEGER PRIMARY KEY,
  session_id INTEGER NOT NULL REFERENCES session,
  id TEXT NOT NULL,
  number INTEGER NOT NULL,
  object TEXT NOT NULL,
  placement TEXT NOT NULL,
  stage INTEGER NOT NULL CHECK(stage BETWEEN 1 AND 4),
  attempt INTEGER NOT NULL,
  program_id INTEGER NOT NULL,
  boot_id INTEGER NOT NULL,
  error TEXT NOT NULL,
  round INTEGER, face INTEGER,

  command BLOB NOT NULL,
  target_x_m REAL, target_y_m REAL, target_z_m REAL,
  approach_x REAL, approach_y REAL, approach_z REAL,
  lateral_x REAL, lateral_y REAL, lateral_z REAL,
  standoff_m REAL, commanded_speed_m_s REAL,

  measured_speed_m_s REAL,
  session_time_s REAL,
  start_unix_s REAL,
  time_uncertainty_s REAL,
  synchronisation_uncertainty_s REAL,
  effector_drift REAL,
  recovered INTEGER NOT NULL DEFAULT 0,
  UNIQUE(session_id, id),
  UNIQUE(session_id, number));
CREATE INDEX touch_stage ON touch(session_id, stage);
CREATE INDEX touch_unfinished ON touch(stage) WHERE stage < 3;
CREATE TABLE touch_finger(
  touch_id INTEGER NOT NULL REFERENCES touch,
  finger INTEGER NOT NULL,
  contact_time_s REAL,
  x_m REAL, y_m REAL, z_m REAL,
  rotation_x_rad REAL, rotation_y_rad REAL, rotation_z_rad REAL,
  ticks INTEGER NOT NULL,
  PRIMARY KEY(touch_id, finger)) WITHOUT ROWID;
CREATE TABLE image(
  image_id INTEGER PRIMARY KEY,
  session_id INTEGER NOT NULL REFERENCES session,
  id TEXT NOT NULL,
  number INTEGER NOT NULL,
  object TEXT NOT NULL,
  placement TEXT NOT NULL,
  x_m REAL, y_m REAL, z_m REAL,
  rotation_x_rad REAL, rotation_y_rad REAL, rotation_z_rad REAL,
  unix_s REAL,
  width_px INTEGER NOT NULL, height_px INTEGER NOT NULL,
  png BLOB NOT NULL,
  UNIQUE(session_id, id),
  UNIQUE(session_id, number));
CREATE TABLE fact(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
PRAGMA application_id = 0x54736A31;
PRAGMA user_version = 1;
INSERT INTO session VALUES(1, 's', 1.7e9, 'emulated rig', 'calibration', 1, 0.03), (2, 'empty', 1.7e9, '', '', 3, 0.03);
INSERT INTO session_object VALUES(1, 0, 'cup');
INSERT INTO touch(touch_id, session_id, id, number, object, placement, stage, attempt, program_id, boot_id, error,
    command, measured_speed_m_s, session_time_s, start_unix_s)
  VALUES(1, 1, 'a', 0, 'cup', '+z', 3, 1, 5, 6, '', x'00', 0.02, 3.5, 1.7e9),
        (2, 1, 'b', 1, 'cup', '+z', 4, 1, 6, 6, 'why', x'01', NULL, NULL, NULL);
INSERT INTO touch_finger VALUES(1, 0, 3.625, 1, 2, 3, 4, 5, 6, 77);
INSERT INTO image VALUES(1, 1, 'front', 0, 'cup', '+z', 1, 2, 3, 4, 5, 6, 1.7e9, 4, 3, 'png');
INSERT INTO fact VALUES('mounted_object', 'cup');
)sql";

class JournalVersion1 : public ::testing::Test {
 protected:
  JournalVersion1() {
    path_ = test_folder_.path() + "/session.db";
    Sql(kVersion1);
  }

  void Sql(const char* sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  static void ExpectAll(const Journal& journal) {
    const auto sessions = journal.Sessions();
    ASSERT_TRUE(sessions.ok()) << sessions.status();
    ASSERT_EQ(sessions->size(), 2u);
    EXPECT_EQ((*sessions)[0].calibration, "calibration");
    EXPECT_EQ((*sessions)[0].touches, 2u);
    EXPECT_EQ((*sessions)[0].done, 1u);
    EXPECT_EQ((*sessions)[0].failed, 1u);
    EXPECT_EQ((*sessions)[0].images, 1u);
    EXPECT_EQ((*sessions)[0].objects, std::vector<std::string>{"cup"});
    EXPECT_EQ((*sessions)[0].deleted_unix_s, 0);
    const auto touch = journal.Find("s", "a");
    ASSERT_TRUE(touch.ok() && touch->has_value()) << touch.status();
    EXPECT_EQ((*touch)->result.fingers.at(0).contact_time_s, 3.625);
    EXPECT_EQ((*touch)->result.fingers.at(0).ticks, 77u);
    EXPECT_EQ((*touch)->result.session_time_s, 3.5);
    EXPECT_EQ((*touch)->command, std::string(1, '\0'));
    std::vector<std::string> ids;
    ASSERT_TRUE(journal
                    .ForEachTouch("s",
                                  [&](const JournalTouch& each) {
                                    ids.push_back(each.id);
                                    return true;
                                  })
                    .ok());
    EXPECT_EQ(ids, (std::vector<std::string>{"a", "b"}));
    int images = 0;
    ASSERT_TRUE(journal
                    .ForEachImage("s",
                                  [&](const JournalImage& image) {
                                    ++images;
                                    EXPECT_EQ(image.png, "png");
                                    EXPECT_EQ(image.base_from_camera[5], 6);
                                    EXPECT_TRUE(std::isnan(image.measured_base_from_camera[0]));
                                    return true;
                                  })
                    .ok());
    EXPECT_EQ(images, 1);
    EXPECT_EQ(*journal.Metadata("mounted_object"), "cup");
    EXPECT_EQ(*journal.Metadata("stop"), "");
  }

  const TestFolder test_folder_;
  std::string path_;
};

TEST_F(JournalVersion1, IsReadAsItIsAndStaysIt) {
  for (int k = 0; k < 2; ++k) {
    const auto journal = Journal::Open(path_, Mode::kReadOnly);
    ASSERT_TRUE(journal.ok()) << journal.status();
    EXPECT_FALSE((*journal)->has_checksums());
    ExpectAll(**journal);
    EXPECT_TRUE((*journal)->DeletedSessions()->empty());
    EXPECT_FALSE((*journal)->Series("s", "a")->has_value());
  }
}

TEST_F(JournalVersion1, GetsChecksumsWhenItIsOpenedForWriting) {
  {
    const auto journal = Journal::Open(path_, Mode::kReadWrite);
    ASSERT_TRUE(journal.ok()) << journal.status();
    EXPECT_TRUE((*journal)->has_checksums());
    ExpectAll(**journal);
    EXPECT_EQ((*journal)->Begin("s", "c", "cup", "+z", "2")->number, 2u);
    ASSERT_TRUE((*journal)->Failed("s", "c", "not made").ok());
    EXPECT_EQ((*journal)->Begin("s", "b", "cup", "+z", std::string(1, '\1'))->attempt, 2);
    EXPECT_EQ((*journal)->Session("s")->touches, 3u);
  }
  Sql("UPDATE touch_finger SET contact_time_s = 2.625");
  const auto journal = Journal::Open(path_, Mode::kReadOnly);
  ASSERT_TRUE(journal.ok()) << journal.status();
  EXPECT_TRUE((*journal)->has_checksums());
  EXPECT_THAT(std::string((*journal)->Find("s", "a").status().message()), HasSubstr("touch 0 ('a')"));
}

TEST_F(JournalVersion1, ACopyOfItIsOfThePresentVersion) {
  const auto journal = Journal::Open(path_, Mode::kReadOnly);
  const auto copy = Journal::Open(test_folder_.path() + "/copy.db", Mode::kCreateOrReadWrite);
  ASSERT_TRUE((*journal)->CopySession("s", copy->get()).ok());
  EXPECT_TRUE((*copy)->has_checksums());
  EXPECT_EQ((*(*copy)->Find("s", "a"))->result.fingers.at(0).contact_time_s, 3.625);
}

TEST_F(JournalVersion1, ALaterOneThatCallsItselfVersion1IsDamaged) {
  { ASSERT_TRUE(Journal::Open(path_, Mode::kReadWrite).ok()); }
  Sql("PRAGMA user_version = 1");
  for (const Mode mode : {Mode::kReadOnly, Mode::kReadWrite})
    EXPECT_TRUE(absl::IsDataLoss(Journal::Open(path_, mode).status())) << Journal::Open(path_, mode).status();
}

}  // namespace
}  // namespace touchstone::session
