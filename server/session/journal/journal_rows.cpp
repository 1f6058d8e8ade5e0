#include "server/session/journal/journal_rows.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/images/emulated.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/journal/journal_head.h"
#include "server/session/journal/journal_views.h"

namespace touchstone::session {
namespace {

void BindPose(const std::array<double, 6>& pose, SqliteStatement* statement) {
  for (const double value : pose) statement->Bind(value);
}

std::array<double, 6> ReadPose(const SqliteStatement& statement, int column) {
  std::array<double, 6> pose;
  for (int i = 0; i < 6; ++i) pose[i] = statement.Double(column + i);
  return pose;
}

void BindOptional(const std::optional<int>& value, SqliteStatement* statement) {
  if (value)
    statement->Bind(int64_t{*value});
  else
    statement->BindNull();
}

std::optional<int> ReadOptional(const SqliteStatement& statement, int column) {
  if (statement.IsNull(column)) return std::nullopt;
  return static_cast<int>(statement.Integer(column));
}

// The eleven columns that say to people what the bytes say; nothing where they are no command.
void BindCommand(const std::string& bytes, SqliteStatement* statement) {
  statement->BindBlob(bytes);
  const auto command = ParseCommandBytes(bytes);
  if (!command || !command->has_approach()) {
    for (int i = 0; i < 11; ++i) statement->BindNull();
    return;
  }
  for (const v1::Vector3* vector : {&command->target_m(), &command->approach(), &command->lateral()})
    statement->Bind(vector->x()).Bind(vector->y()).Bind(vector->z());
  statement->Bind(command->standoff_m()).Bind(command->speed_m_s());
}

absl::Status Gone(const SqliteFile& file, absl::string_view what) {
  return absl::InternalError(absl::StrCat("journal ", file.path(), ": a ", what, " has gone; read it again"));
}

}  // namespace

namespace {

// The fact that says whether an emulator made a session; sessions of before it was kept have none.
std::string EmulatedFact(int64_t session_id) {
  return absl::StrCat("session_", session_id, "_emulated");
}

// A journal whose facts are damaged still gives its sessions: Journal::Fact reports the damage.
absl::StatusOr<bool> ReadEmulated(SqliteFile* file, const JournalSession& session) {
  const std::string key = EmulatedFact(session.id);
  SqliteStatement row = file->Prepare("SELECT value FROM fact WHERE key = ?");
  row.Bind(key);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  return found ? row.Text(0) != "0" : NotedAsEmulated(session.provenance);
}

}  // namespace

absl::StatusOr<int64_t> InsertSession(SqliteFile* file, const JournalSession& session) {
  SqliteStatement insert = file->Prepare(
      "INSERT INTO session(name, created_unix_s, source, calibration, fingers, spacing_m, checksum) "
      "VALUES(?, ?, ?, ?, ?, ?, 0)");
  insert.Bind(session.name).Bind(session.created_unix_s).Bind(session.provenance).Bind(session.calibration);
  insert.Bind(int64_t{session.fingers}).Bind(session.spacing_m);
  TOUCHSTONE_RETURN_IF_ERROR(insert.Run());
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t session_id, file->Number("SELECT last_insert_rowid()"));
  TOUCHSTONE_RETURN_IF_ERROR(WriteTally(file, session_id, SessionTally()));
  TOUCHSTONE_RETURN_IF_ERROR(AddToSessionCount(file, 1));
  TOUCHSTONE_RETURN_IF_ERROR(SealSession(file, session_id));
  TOUCHSTONE_RETURN_IF_ERROR(WriteFact(file, EmulatedFact(session_id), session.emulated ? "1" : "0"));
  return session_id;
}

absl::Status InsertObject(SqliteFile* file, int64_t session_id, const std::string& object) {
  {
    SqliteStatement row = file->Prepare("SELECT 1 FROM session_object WHERE session_id = ? AND name = ?");
    row.Bind(session_id).Bind(object);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (found) return absl::OkStatus();
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckSession(file, session_id));
  TOUCHSTONE_RETURN_IF_ERROR(
      file->Prepare("INSERT INTO session_object(session_id, position, name) "
                    "SELECT ?1, count(*), ?2 FROM session_object WHERE session_id = ?1")
          .Bind(session_id)
          .Bind(object)
          .Run());
  return SealSession(file, session_id);
}

absl::Status InsertTouch(SqliteFile* file, int64_t session_id, const JournalTouch& touch,
                         const JournalSeries* series, SessionTally* tally) {
  TOUCHSTONE_RETURN_IF_ERROR(InsertObject(file, session_id, touch.object));
  int64_t touch_id = 0;
  {
    SqliteStatement insert = file->Prepare(
        "INSERT INTO touch(session_id, id, number, object, placement, stage, attempt, program_id, boot_id, "
        "error, "
        "round, face, command, target_x_m, target_y_m, target_z_m, approach_x, approach_y, approach_z, "
        "lateral_x, lateral_y, lateral_z, standoff_m, commanded_speed_m_s, measured_speed_m_s, "
        "session_time_s, "
        "start_unix_s, time_uncertainty_s, synchronisation_uncertainty_s, effector_drift, recovered, "
        "checksum) "
        "VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
        "?, 0)");
    insert.Bind(session_id).Bind(touch.id).Bind(static_cast<int64_t>(touch.number));
    insert.Bind(touch.object).Bind(touch.up_face).Bind(static_cast<int64_t>(touch.stage));
    insert.Bind(int64_t{touch.attempt}).Bind(int64_t{touch.program_id}).Bind(int64_t{touch.boot_id});
    insert.Bind(touch.error);
    BindOptional(touch.round, &insert);
    BindOptional(touch.face, &insert);
    BindCommand(touch.command, &insert);
    if (touch.stage == TouchStage::kDone) {
      const JournalResult& result = touch.result;
      insert.Bind(result.speed_m_s).Bind(result.session_time_s).Bind(result.start_unix_s);
      insert.Bind(result.time_uncertainty_s)
          .Bind(result.synchronisation_uncertainty_s)
          .Bind(result.effector_drift);
      insert.Bind(int64_t{result.recovered});
    } else {
      for (int i = 0; i < 6; ++i) insert.BindNull();
      insert.Bind(int64_t{0});
    }
    TOUCHSTONE_RETURN_IF_ERROR(insert.Run());
    TOUCHSTONE_ASSIGN_OR_RETURN(touch_id, file->Number("SELECT last_insert_rowid()"));
  }
  if (touch.stage == TouchStage::kDone) {
    TOUCHSTONE_RETURN_IF_ERROR(InsertFingers(file, touch_id, touch.result.fingers));
    if (series != nullptr) TOUCHSTONE_RETURN_IF_ERROR(InsertSeries(file, touch_id, *series));
  }
  return SealTouch(file, touch_id, nullptr, tally);
}

absl::Status InsertSeries(SqliteFile* file, int64_t touch_id, const JournalSeries& series) {
  TOUCHSTONE_RETURN_IF_ERROR(
      file->Prepare("INSERT OR REPLACE INTO touch_series(touch_id, encoding, columns) VALUES(?, ?, ?)")
          .Bind(touch_id)
          .Bind(series.encoding)
          .BindBlob(series.columns)
          .Run());
  return file->Prepare("UPDATE touch SET series_checksum = ? WHERE touch_id = ?")
      .Bind(static_cast<int64_t>(SeriesChecksum(series)))
      .Bind(touch_id)
      .Run();
}

absl::StatusOr<std::optional<JournalSeries>> ReadSeries(SqliteFile* file, int64_t touch_id) {
  const SqliteSnapshot snapshot(file);
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouch(file, touch_id).status());
  SqliteStatement touch = file->Prepare("SELECT series_checksum, number, id FROM touch WHERE touch_id = ?");
  touch.Bind(touch_id);
  TOUCHSTONE_RETURN_IF_ERROR(touch.Step().status());
  if (touch.IsNull(0)) return std::optional<JournalSeries>();
  SqliteStatement row = file->Prepare("SELECT encoding, columns FROM touch_series WHERE touch_id = ?");
  row.Bind(touch_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  JournalSeries series;
  if (found) series.encoding = row.Text(0), series.columns = row.Text(1);
  if (found && SeriesChecksum(series) == static_cast<uint64_t>(touch.Integer(0)))
    return std::optional<JournalSeries>(std::move(series));
  return absl::DataLossError(absl::StrCat(
      "journal ", file->path(), ": the time series of touch ", touch.Integer(1), " ('", touch.Text(2),
      "') is ", found ? "damaged: what is stored differs from its checksum" : "lost",
      "; keep a copy, and export without it (--skip-damaged)"));
}

absl::Status InsertFingers(SqliteFile* file, int64_t touch_id, const std::vector<JournalFinger>& fingers) {
  for (size_t i = 0; i < fingers.size(); ++i) {
    SqliteStatement insert = file->Prepare(
        "INSERT INTO touch_finger(touch_id, finger, contact_time_s, x_m, y_m, z_m, rotation_x_rad, "
        "rotation_y_rad, "
        "rotation_z_rad, ticks) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
    insert.Bind(touch_id).Bind(static_cast<int64_t>(i)).Bind(fingers[i].contact_time_s);
    BindPose(fingers[i].base_from_tip, &insert);
    insert.Bind(static_cast<int64_t>(fingers[i].ticks));
    TOUCHSTONE_RETURN_IF_ERROR(insert.Run());
  }
  return absl::OkStatus();
}

absl::Status InsertImage(SqliteFile* file, int64_t session_id, const JournalImage& image,
                         SessionTally* tally) {
  SqliteStatement insert = file->Prepare(
      "INSERT INTO image(session_id, id, number, object, placement, x_m, y_m, z_m, rotation_x_rad, "
      "rotation_y_rad, "
      "rotation_z_rad, measured_x_m, measured_y_m, measured_z_m, measured_rotation_x_rad, "
      "measured_rotation_y_rad, measured_rotation_z_rad, measured_unix_s, unix_s, width_px, height_px, png, "
      "checksum) "
      "VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 0)");
  insert.Bind(session_id).Bind(image.id).Bind(static_cast<int64_t>(image.number));
  insert.Bind(image.object).Bind(image.up_face);
  BindPose(image.base_from_camera, &insert);
  BindPose(image.measured_base_from_camera, &insert);
  insert.Bind(image.measured_unix_s);
  insert.Bind(image.unix_s).Bind(int64_t{image.width}).Bind(int64_t{image.height}).BindBlob(image.png);
  TOUCHSTONE_RETURN_IF_ERROR(insert.Run());
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t image_id, file->Number("SELECT last_insert_rowid()"));
  if (image.view) TOUCHSTONE_RETURN_IF_ERROR(InsertView(file, image_id, *image.view));
  return SealNewImage(file, image_id, tally);
}

absl::StatusOr<JournalTouch> ReadTouch(SqliteFile* file, int64_t touch_id) {
  const SqliteSnapshot snapshot(file);
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouch(file, touch_id).status());
  JournalTouch touch;
  {
    SqliteStatement row = file->Prepare(
        "SELECT id, number, object, placement, stage, attempt, program_id, boot_id, error, round, face, "
        "command, "
        "measured_speed_m_s, session_time_s, start_unix_s, time_uncertainty_s, "
        "synchronisation_uncertainty_s, "
        "effector_drift, recovered FROM touch WHERE touch_id = ?");
    row.Bind(touch_id);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return Gone(*file, "touch");
    touch.id = row.Text(0);
    touch.number = static_cast<uint64_t>(row.Integer(1));
    touch.object = row.Text(2);
    touch.up_face = row.Text(3);
    touch.stage = static_cast<TouchStage>(row.Integer(4));
    touch.attempt = static_cast<int>(row.Integer(5));
    touch.program_id = static_cast<uint32_t>(row.Integer(6));
    touch.boot_id = static_cast<uint32_t>(row.Integer(7));
    touch.error = row.Text(8);
    touch.round = ReadOptional(row, 9);
    touch.face = ReadOptional(row, 10);
    touch.command = row.Text(11);
    if (touch.stage != TouchStage::kDone) return touch;
    touch.result.speed_m_s = row.Double(12);
    touch.result.session_time_s = row.Double(13);
    touch.result.start_unix_s = row.Double(14);
    touch.result.time_uncertainty_s = row.Double(15);
    touch.result.synchronisation_uncertainty_s = row.Double(16);
    touch.result.effector_drift = row.Double(17);
    touch.result.recovered = row.Integer(18) != 0;
  }
  SqliteStatement row = file->Prepare(
      "SELECT contact_time_s, x_m, y_m, z_m, rotation_x_rad, rotation_y_rad, rotation_z_rad, ticks "
      "FROM touch_finger WHERE touch_id = ? ORDER BY finger");
  row.Bind(touch_id);
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return touch;
    JournalFinger& finger = touch.result.fingers.emplace_back();
    finger.contact_time_s = row.Double(0);
    finger.base_from_tip = ReadPose(row, 1);
    finger.ticks = static_cast<uint64_t>(row.Integer(7));
  }
}

absl::StatusOr<JournalImage> ReadImage(SqliteFile* file, int64_t image_id) {
  const SqliteSnapshot snapshot(file);
  TOUCHSTONE_RETURN_IF_ERROR(CheckImage(file, image_id));
  SqliteStatement row = file->Prepare(
      "SELECT id, number, object, placement, x_m, y_m, z_m, rotation_x_rad, rotation_y_rad, rotation_z_rad, "
      "unix_s, "
      "width_px, height_px, png, measured_x_m, measured_y_m, measured_z_m, measured_rotation_x_rad, "
      "measured_rotation_y_rad, measured_rotation_z_rad, measured_unix_s FROM image WHERE image_id = ?");
  row.Bind(image_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (!found) return Gone(*file, "picture");
  JournalImage image;
  image.id = row.Text(0);
  image.number = static_cast<uint64_t>(row.Integer(1));
  image.object = row.Text(2);
  image.up_face = row.Text(3);
  image.base_from_camera = ReadPose(row, 4);
  image.unix_s = row.Double(10);
  image.width = static_cast<int>(row.Integer(11));
  image.height = static_cast<int>(row.Integer(12));
  image.png = row.Text(13);
  image.measured_base_from_camera = ReadPose(row, 14);
  image.measured_unix_s = row.Double(20);
  TOUCHSTONE_ASSIGN_OR_RETURN(image.view, ReadView(file, image_id));
  return image;
}

absl::StatusOr<JournalSession> ReadSession(SqliteFile* file, int64_t session_id, bool with_counts) {
  const SqliteSnapshot snapshot(file);
  JournalSession session;
  session.id = session_id;
  {
    SqliteStatement row = file->Prepare(
        "SELECT name, created_unix_s, source, calibration, fingers, spacing_m, deleted_unix_s, deleted_by "
        "FROM session WHERE session_id = ?");
    row.Bind(session_id);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return Gone(*file, "session");
    session.name = row.Text(0);
    session.created_unix_s = row.Double(1);
    session.provenance = row.Text(2);
    session.calibration = row.Text(3);
    session.fingers = static_cast<int>(row.Integer(4));
    session.spacing_m = row.Double(5);
    if (!row.IsNull(6)) session.deleted_unix_s = row.Double(6);
    session.deleted_by = row.Text(7);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(session.emulated, ReadEmulated(file, session));
  SessionTally tally;
  if (with_counts) {
    TOUCHSTONE_ASSIGN_OR_RETURN(tally, ReadTally(file, session_id));
  }
  session.touches = static_cast<uint64_t>(tally.touches);
  session.done = static_cast<uint64_t>(tally.done);
  session.failed = static_cast<uint64_t>(tally.failed);
  session.images = static_cast<uint64_t>(tally.images);
  SqliteStatement row =
      file->Prepare("SELECT name FROM session_object WHERE session_id = ? ORDER BY position");
  row.Bind(session_id);
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return session;
    session.objects.push_back(row.Text(0));
  }
}

}  // namespace touchstone::session
