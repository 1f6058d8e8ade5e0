#include "server/session/journal/journal_version1.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/journal/journal_head.h"
#include "server/session/journal/journal_schema.h"
#include "server/session/journal/journal_seal.h"
#include "server/session/journal/journal_version2.h"

namespace touchstone::session {
namespace {

// The tables of the present version, seen in those of version 1; what is temporary goes before what is in the file.
constexpr char kVersion1Views[] = R"sql(
PRAGMA temp_store = MEMORY;
CREATE TEMP VIEW session AS
  SELECT *, NULL AS deleted_unix_s, '' AS deleted_by, '' AS clock_boot_id, NULL AS clock_origin_s, 0 AS checksum
  FROM main.session;
CREATE TEMP VIEW session_tally AS
  SELECT session_id,
    (SELECT count(*) FROM main.touch t WHERE t.session_id = s.session_id) AS touches,
    (SELECT count(*) FROM main.touch t WHERE t.session_id = s.session_id AND stage = 3) AS done,
    (SELECT count(*) FROM main.touch t WHERE t.session_id = s.session_id AND stage = 4) AS failed,
    0 AS touch_digest,
    (SELECT count(*) FROM main.image i WHERE i.session_id = s.session_id) AS images,
    0 AS image_digest, 0 AS checksum
  FROM main.session s;
CREATE TEMP VIEW touch AS SELECT *, NULL AS series_checksum, 0 AS checksum FROM main.touch;
CREATE TEMP VIEW touch_series AS SELECT 0 AS touch_id, '' AS encoding, x'' AS columns WHERE 0;
CREATE TEMP VIEW image AS
  SELECT *, NULL AS measured_x_m, NULL AS measured_y_m, NULL AS measured_z_m, NULL AS measured_rotation_x_rad,
    NULL AS measured_rotation_y_rad, NULL AS measured_rotation_z_rad, NULL AS measured_unix_s, 0 AS checksum
  FROM main.image;
CREATE TEMP VIEW fact AS SELECT *, 0 AS checksum FROM main.fact;
)sql";

constexpr char kMoveAside[] = R"sql(
DROP INDEX touch_stage;
DROP INDEX touch_unfinished;
ALTER TABLE session RENAME TO session_version1;
ALTER TABLE session_object RENAME TO session_object_version1;
ALTER TABLE touch RENAME TO touch_version1;
ALTER TABLE touch_finger RENAME TO touch_finger_version1;
ALTER TABLE image RENAME TO image_version1;
ALTER TABLE fact RENAME TO fact_version1;
)sql";

constexpr char kCopy[] = R"sql(
INSERT INTO session(session_id, name, created_unix_s, source, calibration, fingers, spacing_m, checksum)
  SELECT session_id, name, created_unix_s, source, calibration, fingers, spacing_m, 0 FROM session_version1;
INSERT INTO session_object SELECT * FROM session_object_version1;
INSERT INTO touch(touch_id, session_id, id, number, object, placement, stage, attempt, program_id, boot_id, error,
    round, face, command, target_x_m, target_y_m, target_z_m, approach_x, approach_y, approach_z, lateral_x, lateral_y,
    lateral_z, standoff_m, commanded_speed_m_s, measured_speed_m_s, session_time_s, start_unix_s, time_uncertainty_s,
    synchronisation_uncertainty_s, effector_drift, recovered, checksum)
  SELECT touch_id, session_id, id, number, object, placement, stage, attempt, program_id, boot_id, error,
    round, face, command, target_x_m, target_y_m, target_z_m, approach_x, approach_y, approach_z, lateral_x, lateral_y,
    lateral_z, standoff_m, commanded_speed_m_s, measured_speed_m_s, session_time_s, start_unix_s, time_uncertainty_s,
    synchronisation_uncertainty_s, effector_drift, recovered, 0 FROM touch_version1;
INSERT INTO touch_finger SELECT * FROM touch_finger_version1;
INSERT INTO image(image_id, session_id, id, number, object, placement, x_m, y_m, z_m, rotation_x_rad, rotation_y_rad,
    rotation_z_rad, unix_s, width_px, height_px, png, checksum)
  SELECT image_id, session_id, id, number, object, placement, x_m, y_m, z_m, rotation_x_rad, rotation_y_rad,
    rotation_z_rad, unix_s, width_px, height_px, png, 0 FROM image_version1;
)sql";

constexpr char kDropOld[] = R"sql(
DROP TABLE touch_finger_version1;
DROP TABLE touch_version1;
DROP TABLE image_version1;
DROP TABLE session_object_version1;
DROP TABLE session_version1;
DROP TABLE fact_version1;
)sql";

template <typename Work>
absl::Status ForEachRow(SqliteStatement rows, Work work) {
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, rows.Step());
    if (!found) return absl::OkStatus();
    TOUCHSTONE_RETURN_IF_ERROR(work(rows));
  }
}

absl::StatusOr<std::vector<int64_t>> ReadIds(SqliteStatement rows) {
  std::vector<int64_t> ids;
  TOUCHSTONE_RETURN_IF_ERROR(ForEachRow(std::move(rows), [&](const SqliteStatement& row) {
    ids.push_back(row.Integer(0));
    return absl::OkStatus();
  }));
  return ids;
}

// A damaged number must not pass for a version that checks nothing.
absl::Status WantNoLaterTable(SqliteFile* file) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t later,
                              file->Number("SELECT count(*) FROM main.sqlite_master WHERE name = 'head'"));
  if (later == 0) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat("journal ", file->path(),
                   " is damaged: it calls itself version 1 and has tables of a later one; ", kRescueTheFile));
}

absl::Status SealAll(SqliteFile* file) {
  TOUCHSTONE_RETURN_IF_ERROR(InsertHead(file));
  TOUCHSTONE_RETURN_IF_ERROR(
      ForEachRow(file->Prepare("SELECT key, value FROM fact_version1"),
                 [&](const SqliteStatement& row) { return WriteFact(file, row.Text(0), row.Text(1)); }));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int64_t> sessions,
                              ReadIds(file->Prepare("SELECT session_id FROM session")));
  for (const int64_t session_id : sessions) {
    SessionTally tally;
    SqliteStatement touches = file->Prepare("SELECT touch_id FROM touch WHERE session_id = ?");
    touches.Bind(session_id);
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<int64_t> ids, ReadIds(std::move(touches)));
    for (const int64_t id : ids) TOUCHSTONE_RETURN_IF_ERROR(SealTouch(file, id, nullptr, &tally));
    SqliteStatement images = file->Prepare("SELECT image_id FROM image WHERE session_id = ?");
    images.Bind(session_id);
    TOUCHSTONE_ASSIGN_OR_RETURN(ids, ReadIds(std::move(images)));
    for (const int64_t id : ids) TOUCHSTONE_RETURN_IF_ERROR(SealNewImage(file, id, &tally));
    TOUCHSTONE_RETURN_IF_ERROR(WriteTally(file, session_id, tally));
    TOUCHSTONE_RETURN_IF_ERROR(SealSession(file, session_id));
  }
  return AddToSessionCount(file, static_cast<int64_t>(sessions.size()));
}

}  // namespace

absl::Status ReadAsVersion1(SqliteFile* file) {
  TOUCHSTONE_RETURN_IF_ERROR(WantNoLaterTable(file));
  file->set_has_checksums(false);
  TOUCHSTONE_RETURN_IF_ERROR(file->Run(kVersion1Views));
  return file->Run(kNoViews);
}

absl::Status MigrateFromVersion1(SqliteFile* file) {
  TOUCHSTONE_RETURN_IF_ERROR(WantNoLaterTable(file));
  return file->Transact([&]() -> absl::Status {
    for (const char* sql : {kMoveAside, kJournalSchema, kViewSchema, kCopy})
      TOUCHSTONE_RETURN_IF_ERROR(file->Run(sql));
    TOUCHSTONE_RETURN_IF_ERROR(SealAll(file));
    TOUCHSTONE_RETURN_IF_ERROR(file->Run(kDropOld));
    static const std::string version = absl::StrCat("PRAGMA user_version = ", kJournalVersion);
    return file->Run(version.c_str());
  });
}

}  // namespace touchstone::session
