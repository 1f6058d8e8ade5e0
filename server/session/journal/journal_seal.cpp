#include "server/session/journal/journal_seal.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::session {
namespace {

uint64_t ChecksumOf(absl::string_view bytes) {
  uint64_t checksum = 0;
  (void)absl::SimpleHexAtoi(Sha256Hex(bytes).substr(0, 16), &checksum);
  return checksum;
}

// Appends all rows of a query, each with its place.
absl::Status AppendRows(SqliteStatement rows, std::string* bytes) {
  for (int64_t place = 0;; ++place) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, rows.Step());
    if (!found) return absl::OkStatus();
    absl::StrAppend(bytes, place, ":");
    rows.AppendRow("checksum", bytes);
  }
}

absl::StatusOr<uint64_t> Checksum(SqliteFile* file, std::initializer_list<const char*> queries, int64_t key) {
  std::string bytes;
  for (const char* query : queries) {
    bytes += '|';
    SqliteStatement rows = file->Prepare(query);
    rows.Bind(key);
    TOUCHSTONE_RETURN_IF_ERROR(AppendRows(std::move(rows), &bytes));
  }
  return ChecksumOf(bytes);
}

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

// The session's name as far as it can be read.
std::string NameOf(SqliteFile* file, int64_t session_id) {
  SqliteStatement row = file->Prepare("SELECT name FROM session WHERE session_id = ?");
  row.Bind(session_id);
  const auto found = row.Step();
  return found.ok() && *found ? row.Text(0) : absl::StrCat("number ", session_id);
}

absl::Status Damaged(const SqliteFile& file, absl::string_view what, absl::string_view remedy) {
  return absl::DataLossError(absl::StrCat("journal ", file.path(), ": ", what, "; ", remedy));
}

// What helps against a row that is damaged or missing.
std::string ExportTheRest(const SqliteFile& file, absl::string_view session) {
  return absl::StrCat("keep a copy, then write what is whole with: touchstone session export ", file.path(),
                      " ", session, " --skip-damaged -o rest.h5");
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
  const std::string session = NameOf(file, session_id);
  const char* things = images ? "pictures" : "touches";
  return Damaged(
      *file,
      absl::StrCat("session '", session, "' is damaged: ", ids->size(), " of its ", count, " ", things,
                   " are found",
                   count == static_cast<int64_t>(ids->size()) ? ", but not those that were written" : ""),
      ExportTheRest(*file, session));
}

struct Head {
  int64_t sessions = 0;
  uint64_t fact_digest = 0;
};

absl::StatusOr<Head> ReadHead(SqliteFile* file) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t checksum,
                              Checksum(file, {"SELECT * FROM head WHERE head_id = ?"}, 1));
  SqliteStatement row = file->Prepare("SELECT sessions, fact_digest, checksum FROM head WHERE head_id = 1");
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (!found || static_cast<uint64_t>(row.Integer(2)) != checksum)
    return Damaged(*file, "its own row (table head) is damaged", ExportTheRest(*file, "SESSION"));
  return Head{row.Integer(0), static_cast<uint64_t>(row.Integer(1))};
}

absl::Status WriteHead(SqliteFile* file, const Head& head) {
  TOUCHSTONE_RETURN_IF_ERROR(
      file->Prepare("INSERT INTO head(head_id, sessions, fact_digest, checksum) VALUES(1, ?, ?, "
                    "0) ON CONFLICT(head_id) DO UPDATE SET sessions = excluded.sessions, "
                    "fact_digest = excluded.fact_digest")
          .Bind(head.sessions)
          .Bind(static_cast<int64_t>(head.fact_digest))
          .Run());
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t checksum,
                              Checksum(file, {"SELECT * FROM head WHERE head_id = ?"}, 1));
  return file->Prepare("UPDATE head SET checksum = ?").Bind(static_cast<int64_t>(checksum)).Run();
}

uint64_t FactChecksum(const std::string& key, const std::string& value) {
  return ChecksumOf(absl::StrCat("fact|", key.size(), ":", key, value));
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
    const std::string session = NameOf(file, session_id);
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
  if (!found)
    return Damaged(*file, absl::StrCat("the touch in row ", touch_id, " is gone"),
                   "if nobody has deleted its session meanwhile, the journal is damaged: read it again");
  if (file->has_checksums() && checksum != static_cast<uint64_t>(row.Integer(1))) {
    const std::string session = NameOf(file, row.Integer(4));
    return Damaged(*file,
                   absl::StrCat("touch ", row.Integer(2), " ('", row.Text(3), "') of session '", session,
                                "' is damaged: what is stored differs from its checksum"),
                   ExportTheRest(*file, session));
  }
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
  if (!found)
    return Damaged(*file, absl::StrCat("the picture in row ", image_id, " is gone"),
                   "if nobody has deleted its session meanwhile, the journal is damaged: read it again");
  if (checksum == static_cast<uint64_t>(row.Integer(0))) return absl::OkStatus();
  const std::string session = NameOf(file, row.Integer(3));
  return Damaged(*file,
                 absl::StrCat("picture ", row.Integer(1), " ('", row.Text(2), "') of session '", session,
                              "' is damaged: what is stored differs from its checksum"),
                 ExportTheRest(*file, session));
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
  const std::string session = found ? row.Text(1) : NameOf(file, session_id);
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

absl::Status InsertHead(SqliteFile* file) {
  return WriteHead(file, Head());
}

absl::Status AddToSessionCount(SqliteFile* file, int64_t change) {
  TOUCHSTONE_ASSIGN_OR_RETURN(Head head, ReadHead(file));
  head.sessions += change;
  return WriteHead(file, head);
}

absl::Status CheckSessionCount(SqliteFile* file) {
  if (!file->has_checksums()) return absl::OkStatus();
  const SqliteSnapshot snapshot(file);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Head head, ReadHead(file));
  // By the table itself and not by an index.
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t found, file->Number("SELECT count(*) FROM session NOT INDEXED"));
  if (found == head.sessions) return absl::OkStatus();
  return Damaged(*file, absl::StrCat(found, " of its ", head.sessions, " sessions are found"),
                 ExportTheRest(*file, "SESSION"));
}

absl::Status WriteFact(SqliteFile* file, const std::string& key, const std::string& value) {
  TOUCHSTONE_ASSIGN_OR_RETURN(Head head, ReadHead(file));
  {
    SqliteStatement row = file->Prepare("SELECT checksum FROM fact WHERE key = ?");
    row.Bind(key);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (found) head.fact_digest -= static_cast<uint64_t>(row.Integer(0));
  }
  const uint64_t checksum = FactChecksum(key, value);
  head.fact_digest += checksum;
  TOUCHSTONE_RETURN_IF_ERROR(
      file->Prepare(
              "INSERT INTO fact(key, value, checksum) VALUES(?, ?, ?) ON CONFLICT(key) DO UPDATE SET value = "
              "excluded.value, checksum = excluded.checksum")
          .Bind(key)
          .Bind(value)
          .Bind(static_cast<int64_t>(checksum))
          .Run());
  return WriteHead(file, head);
}

absl::StatusOr<std::string> ReadFact(SqliteFile* file, const std::string& key) {
  const SqliteSnapshot snapshot(file);
  const std::string remedy =
      "keep a copy, export its sessions, and let the gateway begin a new journal; then say what lies on the "
      "fixture "
      "(touchstone rig mount)";
  SqliteStatement row = file->Prepare("SELECT value, checksum FROM fact WHERE key = ?");
  row.Bind(key);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (found) {
    std::string value = row.Text(0);
    if (file->has_checksums() && static_cast<uint64_t>(row.Integer(1)) != FactChecksum(key, value))
      return Damaged(
          *file,
          absl::StrCat("what it says of '", key, "' is damaged: '", value, "' differs from its checksum"),
          remedy);
    return value;
  }
  if (!file->has_checksums()) return std::string();
  // That it is not there must be true.
  TOUCHSTONE_ASSIGN_OR_RETURN(const Head head, ReadHead(file));
  uint64_t digest = 0;
  SqliteStatement all = file->Prepare("SELECT key, value FROM fact");
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool more, all.Step());
    if (!more) break;
    digest += FactChecksum(all.Text(0), all.Text(1));
  }
  if (digest == head.fact_digest) return std::string();
  return Damaged(*file, absl::StrCat("it does not say '", key, "', and one of its facts is damaged or lost"),
                 remedy);
}

uint64_t SeriesChecksum(const JournalSeries& series) {
  return ChecksumOf(absl::StrCat("series|", series.encoding.size(), ":", series.encoding, series.columns));
}

}  // namespace touchstone::session
