#include "server/session/journal/journal_seal.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/journal/journal_checksum.h"

namespace touchstone::session {
namespace {

absl::StatusOr<uint64_t> TouchChecksum(SqliteFile* file, int64_t touch_id) {
  return Checksum(file,
                  {"SELECT * FROM touch WHERE touch_id = ?",
                   "SELECT * FROM touch_finger WHERE touch_id = ? ORDER BY finger"},
                  touch_id);
}

absl::StatusOr<uint64_t> ImageChecksum(SqliteFile* file, int64_t image_id) {
  static constexpr char kImage[] = "SELECT * FROM image WHERE image_id = ?";
  static constexpr char kView[] = "SELECT * FROM image_view WHERE image_id = ?";
  bool has_view = false;
  {
    SqliteStatement view = file->Prepare("SELECT 1 FROM image_view WHERE image_id = ?");
    view.Bind(image_id);
    TOUCHSTONE_ASSIGN_OR_RETURN(has_view, view.Step());
  }
  // A picture of version 2 keeps the checksum that it got there.
  if (!has_view) return Checksum(file, {kImage}, image_id);
  return Checksum(file, {kImage, kView}, image_id);
}

absl::StatusOr<uint64_t> SessionChecksum(SqliteFile* file, int64_t session_id) {
  return Checksum(file,
                  {"SELECT * FROM session WHERE session_id = ?",
                   "SELECT * FROM session_object WHERE session_id = ? ORDER BY position, name"},
                  session_id);
}

absl::Status IsGone(const SqliteFile& file, const char* thing, int64_t row_id) {
  return Damaged(file, absl::StrCat("the ", thing, " in row ", row_id, " is gone"),
                 "if nobody has deleted its session meanwhile, the journal is damaged: read it again");
}

// `row`: "touch 3 ('id')".
absl::Status Differs(SqliteFile* file, const std::string& row, int64_t session_id) {
  const std::string session = NameOfSession(file, session_id);
  return Damaged(
      *file,
      absl::StrCat(row, " of session '", session, "' is damaged: what is stored differs from its checksum"),
      ExportTheRest(*file, session));
}

// What is listed of a session's rows: `ids`, the sum of their checksums, and whether their numbers rise.
struct Listing {
  std::vector<int64_t> ids;
  uint64_t digest = 0;
  bool in_order = true;
};

absl::Status List(SqliteFile* file, const char* query, int64_t session_id, Listing* listing) {
  SqliteStatement rows = file->Prepare(query);
  rows.Bind(session_id);
  for (int64_t last = -1;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, rows.Step());
    if (!found) return absl::OkStatus();
    listing->ids.push_back(rows.Integer(0));
    listing->digest += static_cast<uint64_t>(rows.Integer(2));
    listing->in_order = listing->in_order && rows.Integer(1) > last;
    last = rows.Integer(1);
  }
}

// `by_index` reads nothing but the index: it still lists rows whose page is damaged.
absl::Status ReadIds(SqliteFile* file, const char* query, const char* by_index, int64_t session_id,
                     bool images, std::vector<int64_t>* ids) {
  Listing listing;
  const absl::Status listed = List(file, query, session_id, &listing);
  if (!listed.ok()) {
    listing = Listing();
    List(file, by_index, session_id, &listing).IgnoreError();
  }
  const uint64_t digest = listing.digest;
  const bool in_order = listing.in_order;
  *ids = std::move(listing.ids);
  if (!listed.ok()) return listed;
  if (!file->has_checksums()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const SessionTally tally, ReadTally(file, session_id));
  const int64_t count = images ? tally.images : tally.touches;
  if (in_order && count == static_cast<int64_t>(ids->size()) &&
      digest == (images ? tally.image_digest : tally.touch_digest))
    return absl::OkStatus();
  const std::string session = NameOfSession(file, session_id);
  const char* things = images ? "pictures" : "touches";
  return Damaged(
      *file,
      absl::StrCat("session '", session, "' is damaged: ", ids->size(), " of its ", count, " ", things,
                   " are found",
                   count == static_cast<int64_t>(ids->size()) ? ", but not those that were written" : ""),
      ExportTheRest(*file, session));
}

}  // namespace

absl::StatusOr<SessionTally> ReadTally(SqliteFile* file, int64_t session_id) {
  uint64_t checksum = 0;
  if (file->has_checksums()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        checksum, Checksum(file, {"SELECT * FROM session_tally WHERE session_id = ?"}, session_id));
  }
  SessionTally tally;
  SqliteStatement row = file->Prepare(
      "SELECT touches, done, failed, touch_digest, images, image_digest, checksum FROM session_tally "
      "WHERE session_id = ?");
  row.Bind(session_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (!found || (file->has_checksums() && static_cast<uint64_t>(row.Integer(6)) != checksum)) {
    const std::string session = NameOfSession(file, session_id);
    return Damaged(*file, absl::StrCat("the counts of session '", session, "' are damaged"),
                   ExportTheRest(*file, session));
  }
  tally.touches = row.Integer(0), tally.done = row.Integer(1), tally.failed = row.Integer(2);
  tally.touch_digest = static_cast<uint64_t>(row.Integer(3));
  tally.images = row.Integer(4), tally.image_digest = static_cast<uint64_t>(row.Integer(5));
  return tally;
}

absl::Status WriteTally(SqliteFile* file, int64_t session_id, const SessionTally& tally) {
  TOUCHSTONE_RETURN_IF_ERROR(
      file->Prepare("INSERT INTO session_tally(session_id, touches, done, failed, touch_digest, images, "
                    "image_digest, "
                    "checksum) VALUES(?, ?, ?, ?, ?, ?, ?, 0) ON CONFLICT(session_id) DO UPDATE SET "
                    "touches = excluded.touches, done = excluded.done, failed = excluded.failed, "
                    "touch_digest = excluded.touch_digest, images = excluded.images, "
                    "image_digest = excluded.image_digest")
          .Bind(session_id)
          .Bind(tally.touches)
          .Bind(tally.done)
          .Bind(tally.failed)
          .Bind(static_cast<int64_t>(tally.touch_digest))
          .Bind(tally.images)
          .Bind(static_cast<int64_t>(tally.image_digest))
          .Run());
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const uint64_t checksum,
      Checksum(file, {"SELECT * FROM session_tally WHERE session_id = ?"}, session_id));
  return file->Prepare("UPDATE session_tally SET checksum = ? WHERE session_id = ?")
      .Bind(static_cast<int64_t>(checksum))
      .Bind(session_id)
      .Run();
}

absl::StatusOr<TouchSeal> CheckTouch(SqliteFile* file, int64_t touch_id) {
  const SqliteSnapshot snapshot(file);
  uint64_t checksum = 0;
  if (file->has_checksums()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(checksum, TouchChecksum(file, touch_id));
  }
  SqliteStatement row =
      file->Prepare("SELECT stage, checksum, number, id, session_id FROM touch WHERE touch_id = ?");
  row.Bind(touch_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (!found) return IsGone(*file, "touch", touch_id);
  if (file->has_checksums() && checksum != static_cast<uint64_t>(row.Integer(1)))
    return Differs(file, absl::StrCat("touch ", row.Integer(2), " ('", row.Text(3), "')"), row.Integer(4));
  return TouchSeal{static_cast<uint64_t>(row.Integer(1)), static_cast<TouchStage>(row.Integer(0))};
}

absl::Status SealTouch(SqliteFile* file, int64_t touch_id, const TouchSeal* before, SessionTally* tally) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t checksum, TouchChecksum(file, touch_id));
  TouchStage stage;
  {
    SqliteStatement row = file->Prepare("SELECT stage FROM touch WHERE touch_id = ?");
    row.Bind(touch_id);
    TOUCHSTONE_RETURN_IF_ERROR(row.Step().status());
    stage = static_cast<TouchStage>(row.Integer(0));
  }
  TOUCHSTONE_RETURN_IF_ERROR(file->Prepare("UPDATE touch SET checksum = ? WHERE touch_id = ?")
                                 .Bind(static_cast<int64_t>(checksum))
                                 .Bind(touch_id)
                                 .Run());
  const auto count = [tally](TouchStage counted, int64_t change) {
    if (counted == TouchStage::kDone) tally->done += change;
    if (counted == TouchStage::kFailed) tally->failed += change;
  };
  if (before == nullptr) {
    ++tally->touches;
  } else {
    count(before->stage, -1);
    tally->touch_digest -= before->checksum;
  }
  count(stage, 1);
  tally->touch_digest += checksum;
  return absl::OkStatus();
}

absl::Status CheckImage(SqliteFile* file, int64_t image_id) {
  if (!file->has_checksums()) return absl::OkStatus();
  const SqliteSnapshot snapshot(file);
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t checksum, ImageChecksum(file, image_id));
  SqliteStatement row =
      file->Prepare("SELECT checksum, number, id, session_id FROM image WHERE image_id = ?");
  row.Bind(image_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (!found) return IsGone(*file, "picture", image_id);
  if (checksum == static_cast<uint64_t>(row.Integer(0))) return absl::OkStatus();
  return Differs(file, absl::StrCat("picture ", row.Integer(1), " ('", row.Text(2), "')"), row.Integer(3));
}

absl::Status SealNewImage(SqliteFile* file, int64_t image_id, SessionTally* tally) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t checksum, ImageChecksum(file, image_id));
  ++tally->images;
  tally->image_digest += checksum;
  return file->Prepare("UPDATE image SET checksum = ? WHERE image_id = ?")
      .Bind(static_cast<int64_t>(checksum))
      .Bind(image_id)
      .Run();
}

absl::Status CheckSession(SqliteFile* file, int64_t session_id) {
  if (!file->has_checksums()) return absl::OkStatus();
  const SqliteSnapshot snapshot(file);
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t checksum, SessionChecksum(file, session_id));
  SqliteStatement row = file->Prepare("SELECT checksum, name FROM session WHERE session_id = ?");
  row.Bind(session_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (found && static_cast<uint64_t>(row.Integer(0)) == checksum) return absl::OkStatus();
  const std::string session = found ? row.Text(1) : NameOfSession(file, session_id);
  return Damaged(
      *file,
      absl::StrCat("the head of session '", session,
                   "' (name, fingers, calibration, objects) is damaged: what is stored differs from its "
                   "checksum"),
      ExportTheRest(*file, session));
}

absl::Status SealSession(SqliteFile* file, int64_t session_id) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t checksum, SessionChecksum(file, session_id));
  return file->Prepare("UPDATE session SET checksum = ? WHERE session_id = ?")
      .Bind(static_cast<int64_t>(checksum))
      .Bind(session_id)
      .Run();
}

absl::Status ReadTouchIds(SqliteFile* file, int64_t session_id, std::vector<int64_t>* ids) {
  return ReadIds(file, "SELECT touch_id, number, checksum FROM touch WHERE session_id = ? ORDER BY number",
                 "SELECT touch_id, number, 0 FROM touch WHERE session_id = ? ORDER BY number", session_id,
                 false, ids);
}

absl::Status ReadImageIds(SqliteFile* file, int64_t session_id, std::vector<int64_t>* ids) {
  return ReadIds(file, "SELECT image_id, number, checksum FROM image WHERE session_id = ? ORDER BY number",
                 "SELECT image_id, number, 0 FROM image WHERE session_id = ? ORDER BY number", session_id,
                 true, ids);
}

uint64_t SeriesChecksum(const JournalSeries& series) {
  return ChecksumOf(absl::StrCat("series|", series.encoding.size(), ":", series.encoding, series.columns));
}

}  // namespace touchstone::session
