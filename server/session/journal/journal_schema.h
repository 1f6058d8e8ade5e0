// How a journal stands in SQLite: journal.md says it for people. Internal to session/.
#pragma once

namespace touchstone::session {

inline constexpr int kJournalApplicationId =
    0x54736A31;  // "Tsj1": distinguishes a journal from other SQLite files
// PRAGMA user_version; 1 had no checksums (journal_version1.h), 2 no image_view (journal_version2.h).
inline constexpr int kJournalVersion = 3;

inline constexpr char kJournalSchema[] = R"sql(
CREATE TABLE head(                      -- one row: what the other tables must add up to
  head_id INTEGER PRIMARY KEY CHECK(head_id = 1),
  sessions INTEGER NOT NULL,            -- with those in the trash
  fact_digest INTEGER NOT NULL,         -- sum of the facts' checksums, modulo 2^64
  checksum INTEGER NOT NULL);
CREATE TABLE session(
  session_id INTEGER PRIMARY KEY,
  name TEXT NOT NULL,
  created_unix_s REAL NOT NULL,
  source TEXT NOT NULL,
  calibration TEXT NOT NULL,            -- the calibration file, whole
  fingers INTEGER NOT NULL,
  spacing_m REAL NOT NULL,
  deleted_unix_s REAL,                  -- when it was moved to the trash; NULL: it was not
  deleted_by TEXT NOT NULL DEFAULT '',
  -- Where its time began on the clock of a host's boot (CLOCK_BOOTTIME): session_clock.h of the rig.
  clock_boot_id TEXT NOT NULL DEFAULT '',
  clock_origin_s REAL,
  checksum INTEGER NOT NULL);           -- of this row and its objects
CREATE UNIQUE INDEX session_name ON session(name) WHERE deleted_unix_s IS NULL;
CREATE TABLE session_tally(             -- what a session's rows must add up to
  session_id INTEGER PRIMARY KEY REFERENCES session,
  touches INTEGER NOT NULL, done INTEGER NOT NULL, failed INTEGER NOT NULL,
  touch_digest INTEGER NOT NULL,        -- sum of its touches' checksums, modulo 2^64
  images INTEGER NOT NULL, image_digest INTEGER NOT NULL,
  checksum INTEGER NOT NULL);
CREATE TABLE session_object(            -- in order of appearance
  session_id INTEGER NOT NULL REFERENCES session,
  position INTEGER NOT NULL,
  name TEXT NOT NULL,
  UNIQUE(session_id, name));
CREATE TABLE touch(
  touch_id INTEGER PRIMARY KEY,
  session_id INTEGER NOT NULL REFERENCES session,
  id TEXT NOT NULL,                     -- the client's
  number INTEGER NOT NULL,              -- in the order of the intents
  object TEXT NOT NULL,
  placement TEXT NOT NULL,              -- the face of the object's box that points up
  stage INTEGER NOT NULL CHECK(stage BETWEEN 1 AND 4),  -- 1 intent, 2 executing, 3 done, 4 failed
  attempt INTEGER NOT NULL,
  program_id INTEGER NOT NULL,
  boot_id INTEGER NOT NULL,
  error TEXT NOT NULL,                  -- why it failed
  round INTEGER, face INTEGER,          -- of an imported file
  -- The command: its bytes (touchstone.v1.CommandedTouch), and the same for people; object frame.
  command BLOB NOT NULL,
  target_x_m REAL, target_y_m REAL, target_z_m REAL,
  approach_x REAL, approach_y REAL, approach_z REAL,
  lateral_x REAL, lateral_y REAL, lateral_z REAL,
  standoff_m REAL, commanded_speed_m_s REAL,
  -- The result, if done. NULL: unknown.
  measured_speed_m_s REAL,
  session_time_s REAL,
  start_unix_s REAL,
  time_uncertainty_s REAL,
  synchronisation_uncertainty_s REAL,
  effector_drift REAL,
  recovered INTEGER NOT NULL DEFAULT 0,
  series_checksum INTEGER,              -- of its row of touch_series; NULL: it has none
  checksum INTEGER NOT NULL,            -- of this row and its fingers
  UNIQUE(session_id, id),
  UNIQUE(session_id, number));
CREATE INDEX touch_unfinished ON touch(stage) WHERE stage < 3;
CREATE TABLE touch_finger(              -- one row a finger of every touch that is done
  touch_id INTEGER NOT NULL REFERENCES touch,
  finger INTEGER NOT NULL,              -- from 0
  contact_time_s REAL,                  -- since the approach began; NULL: it reported nothing
  x_m REAL, y_m REAL, z_m REAL,         -- base_from_tip at its contact; NULL: unknown
  rotation_x_rad REAL, rotation_y_rad REAL, rotation_z_rad REAL,
  ticks INTEGER NOT NULL,               -- of the end effector's clock
  PRIMARY KEY(touch_id, finger)) WITHOUT ROWID;
CREATE TABLE touch_series(              -- what was recorded during a touch, if that was asked for
  touch_id INTEGER PRIMARY KEY REFERENCES touch,
  encoding TEXT NOT NULL,               -- how the columns stand in the bytes
  columns BLOB NOT NULL);
CREATE TABLE image(
  image_id INTEGER PRIMARY KEY,
  session_id INTEGER NOT NULL REFERENCES session,
  id TEXT NOT NULL,
  number INTEGER NOT NULL,
  object TEXT NOT NULL,
  placement TEXT NOT NULL,
  x_m REAL, y_m REAL, z_m REAL,         -- base_from_camera as it was commanded
  rotation_x_rad REAL, rotation_y_rad REAL, rotation_z_rad REAL,
  -- base_from_camera as it was measured, and when; NULL: unknown.
  measured_x_m REAL, measured_y_m REAL, measured_z_m REAL,
  measured_rotation_x_rad REAL, measured_rotation_y_rad REAL, measured_rotation_z_rad REAL,
  measured_unix_s REAL,
  unix_s REAL,
  width_px INTEGER NOT NULL, height_px INTEGER NOT NULL,
  png BLOB NOT NULL,
  checksum INTEGER NOT NULL,
  UNIQUE(session_id, id),
  UNIQUE(session_id, number));
CREATE TABLE fact(key TEXT PRIMARY KEY, value TEXT NOT NULL, checksum INTEGER NOT NULL) WITHOUT ROWID;
)sql";

// What version 3 added. image.checksum covers a picture's row here too.
inline constexpr char kViewSchema[] = R"sql(
CREATE TABLE image_view(                -- how a picture was taken; none for those of before version 3
  image_id INTEGER PRIMARY KEY REFERENCES image,
  eye_x_m REAL, eye_y_m REAL, eye_z_m REAL,  -- as it was commanded, object frame
  at_x_m REAL, at_y_m REAL, at_z_m REAL,
  up_x REAL, up_y REAL, up_z REAL,
  object_x_m REAL, object_y_m REAL, object_z_m REAL,  -- base_from_object
  object_rotation_x_rad REAL, object_rotation_y_rad REAL, object_rotation_z_rad REAL,
  session_time_s REAL,                  -- NULL: unknown
  -- The lens, as OpenCV writes it: pixel centres at integers; k1 k2 p1 p2 k3 ... with spaces between.
  fx_px REAL NOT NULL, fy_px REAL NOT NULL, cx_px REAL NOT NULL, cy_px REAL NOT NULL,
  distortion TEXT NOT NULL);
)sql";

}  // namespace touchstone::session
