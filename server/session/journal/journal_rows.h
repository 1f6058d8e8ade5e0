// Rows of a journal's tables and what they stand for. Internal to session/.
#pragma once

#include <cstdint>

#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"
#include "server/session/journal/journal_seal.h"
#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// What is inserted is new: the caller has checked.
absl::StatusOr<int64_t> InsertSession(SqliteFile* file, const JournalSession& session);
absl::Status InsertTouch(SqliteFile* file, int64_t session_id, const JournalTouch& touch,
                         const JournalSeries* series, SessionTally* tally);
absl::Status InsertImage(SqliteFile* file, int64_t session_id, const JournalImage& image,
                         SessionTally* tally);
// Notes that a session has an object, if it is its first touch of it.
absl::Status InsertObject(SqliteFile* file, int64_t session_id, const std::string& object);
absl::Status InsertFingers(SqliteFile* file, int64_t touch_id, const std::vector<JournalFinger>& fingers);
// In place of what the touch has; before it is sealed.
absl::Status InsertSeries(SqliteFile* file, int64_t touch_id, const JournalSeries& series);

// By row id, after its checksum was checked; DATA_LOSS if there is none.
absl::StatusOr<JournalTouch> ReadTouch(SqliteFile* file, int64_t touch_id);
absl::StatusOr<JournalImage> ReadImage(SqliteFile* file, int64_t image_id);
absl::StatusOr<std::optional<JournalSeries>> ReadSeries(SqliteFile* file, int64_t touch_id);

// A session with its objects and, where `with_counts`, its counts, which are checked; its head is not.
absl::StatusOr<JournalSession> ReadSession(SqliteFile* file, int64_t session_id, bool with_counts = true);

}  // namespace touchstone::session
