// How a journal stands in SQLite: journal.md says it for people. Internal to session/.
#pragma once

namespace touchstone::session {

inline constexpr int kJournalApplicationId =
    0x54736A31;                            // "Tsj1": distinguishes a journal from other SQLite files
inline constexpr int kJournalVersion = 1;  // PRAGMA user_version

inline constexpr char kJournalSchema[] = R"sql(
CREATE TABLE session(
  session_id INTEGER PRIMARY KEY,
  name TEXT NOT NULL UNIQUE,
  created_unix_s REAL NOT NULL,
  source TEXT NOT NULL,
  calibration TEXT NOT NULL,            -- the calibration file, whole
  fingers INTEGER NOT NULL,
  spacing_m REAL NOT NULL);
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
  UNIQUE(session_id, id),
  UNIQUE(session_id, number));
CREATE INDEX touch_stage ON touch(session_id, stage);
CREATE INDEX touch_unfinished ON touch(stage) WHERE stage < 3;
CREATE TABLE touch_finger(              -- one row a finger of every touch that is done
  touch_id INTEGER NOT NULL REFERENCES touch,
  finger INTEGER NOT NULL,              -- from 0
  contact_time_s REAL,                  -- since the approach began; NULL: it reported nothing
  x_m REAL, y_m REAL, z_m REAL,         -- base_from_tip at its contact; NULL: unknown
  rotation_x_rad REAL, rotation_y_rad REAL, rotation_z_rad REAL,
  ticks INTEGER NOT NULL,               -- of the end effector's clock
  PRIMARY KEY(touch_id, finger)) WITHOUT ROWID;
CREATE TABLE image(
  image_id INTEGER PRIMARY KEY,
  session_id INTEGER NOT NULL REFERENCES session,
  id TEXT NOT NULL,
  number INTEGER NOT NULL,
  object TEXT NOT NULL,
  placement TEXT NOT NULL,
  x_m REAL, y_m REAL, z_m REAL,         -- base_from_camera
  rotation_x_rad REAL, rotation_y_rad REAL, rotation_z_rad REAL,
  unix_s REAL,
  width_px INTEGER NOT NULL, height_px INTEGER NOT NULL,
  png BLOB NOT NULL,
  UNIQUE(session_id, id),
  UNIQUE(session_id, number));
CREATE TABLE fact(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
)sql";

}  // namespace touchstone::session
