#include "server/session/journal/journal_head.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/journal/journal_checksum.h"

namespace touchstone::session {
namespace {

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

}  // namespace touchstone::session
