// Sessions that go to the trash of a journal, come back, and end.
#include <absl/strings/str_cat.h>

#include <chrono>

#include "server/base/status.h"
#include "server/session/journal/journal_file.h"
#include "server/session/journal/journal_head.h"
#include "server/session/journal/journal_rows.h"

namespace touchstone::session {
namespace {

double UnixNowS() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

absl::StatusOr<std::vector<int64_t>> DeletedIds(SqliteFile* file, const std::string& name) {
  SqliteStatement row = file->Prepare(
      "SELECT session_id FROM session WHERE name = ? AND deleted_unix_s IS NOT NULL "
      "ORDER BY deleted_unix_s DESC, session_id DESC");
  row.Bind(name);
  std::vector<int64_t> ids;
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) break;
    ids.push_back(row.Integer(0));
  }
  if (!ids.empty()) return ids;
  return absl::NotFoundError(absl::StrCat("journal ", file->path(), ": there is no session '", name,
                                          "' in the trash (touchstone session list --deleted shows it)"));
}

}  // namespace

absl::Status JournalFile::WantNothingExecuting(int64_t session_id, const std::string& name) const {
  SqliteStatement executing =
      file_->Prepare("SELECT id FROM touch WHERE session_id = ? AND stage = 2 LIMIT 1");
  executing.Bind(session_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, executing.Step());
  if (!found) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(Called(), "session '", name,
                                                    "' cannot be deleted: its touch '", executing.Text(0),
                                                    "' is executing; wait until it has ended"));
}

absl::Status JournalFile::DeleteSession(const std::string& name, const std::string& by) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(name));
  return Write([&]() -> absl::Status {
    TOUCHSTONE_RETURN_IF_ERROR(WantNothingExecuting(known.session_id, name));
    TOUCHSTONE_RETURN_IF_ERROR(CheckSession(file_.get(), known.session_id));
    TOUCHSTONE_RETURN_IF_ERROR(
        file_->Prepare("UPDATE session SET deleted_unix_s = ?, deleted_by = ? WHERE session_id = ?")
            .Bind(UnixNowS())
            .Bind(by)
            .Bind(known.session_id)
            .Run());
    return SealSession(file_.get(), known.session_id);
  });
}

absl::StatusOr<std::vector<JournalSession>> JournalFile::DeletedSessions() const {
  return SessionsWhere(
      "SELECT session_id FROM session NOT INDEXED WHERE deleted_unix_s IS NOT NULL "
      "ORDER BY deleted_unix_s DESC, session_id DESC");
}

absl::Status JournalFile::RestoreSession(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int64_t> ids, DeletedIds(file_.get(), name));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> there, FindSession(name));
  if (there)
    return absl::AlreadyExistsError(
        absl::StrCat(Called(), "there is a session '", name,
                     "' again; delete that one too, then restore the other: the one "
                     "that was deleted last comes back first"));
  return Write([&]() -> absl::Status {
    TOUCHSTONE_RETURN_IF_ERROR(CheckSession(file_.get(), ids[0]));
    TOUCHSTONE_RETURN_IF_ERROR(
        file_->Prepare("UPDATE session SET deleted_unix_s = NULL, deleted_by = '' WHERE session_id = ?")
            .Bind(ids[0])
            .Run());
    return SealSession(file_.get(), ids[0]);
  });
}

absl::Status JournalFile::PurgeSession(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int64_t> ids, DeletedIds(file_.get(), name));
  return Write([&]() -> absl::Status {
    for (const int64_t id : ids) TOUCHSTONE_RETURN_IF_ERROR(Erase(id));
    return absl::OkStatus();
  });
}

absl::Status JournalFile::Erase(int64_t session_id) {
  for (const char* sql :
       {"DELETE FROM touch_series WHERE touch_id IN (SELECT touch_id FROM touch WHERE session_id = ?)",
        "DELETE FROM touch_finger WHERE touch_id IN (SELECT touch_id FROM touch WHERE session_id = ?)",
        "DELETE FROM touch WHERE session_id = ?",
        "DELETE FROM image_view WHERE image_id IN (SELECT image_id FROM image WHERE session_id = ?)",
        "DELETE FROM image WHERE session_id = ?", "DELETE FROM session_object WHERE session_id = ?",
        "DELETE FROM session_tally WHERE session_id = ?", "DELETE FROM session WHERE session_id = ?"})
    TOUCHSTONE_RETURN_IF_ERROR(file_->Prepare(sql).Bind(session_id).Run());
  return AddToSessionCount(file_.get(), -1);
}

}  // namespace touchstone::session
