#include "server/session/journal/journal_checksum.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::session {
namespace {

// Appends all rows of a query, each with its place.
absl::Status AppendRows(SqliteStatement rows, std::string* bytes) {
  for (int64_t place = 0;; ++place) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, rows.Step());
    if (!found) return absl::OkStatus();
    absl::StrAppend(bytes, place, ":");
    rows.AppendRow("checksum", bytes);
  }
}

}  // namespace

uint64_t ChecksumOf(absl::string_view bytes) {
  uint64_t checksum = 0;
  (void)absl::SimpleHexAtoi(Sha256Hex(bytes).substr(0, 16), &checksum);
  return checksum;
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

std::string NameOfSession(SqliteFile* file, int64_t session_id) {
  SqliteStatement row = file->Prepare("SELECT name FROM session WHERE session_id = ?");
  row.Bind(session_id);
  const auto found = row.Step();
  return found.ok() && *found ? row.Text(0) : absl::StrCat("number ", session_id);
}

absl::Status Damaged(const SqliteFile& file, absl::string_view what, absl::string_view remedy) {
  return absl::DataLossError(absl::StrCat("journal ", file.path(), ": ", what, "; ", remedy));
}

std::string ExportTheRest(const SqliteFile& file, absl::string_view session) {
  return absl::StrCat("keep a copy, then write what is whole with: touchstone session export ", file.path(),
                      " ", session, " --skip-damaged -o rest.h5");
}

}  // namespace touchstone::session
