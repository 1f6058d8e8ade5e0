// How a journal's pictures were taken. Internal to session/.
#pragma once

#include <cstdint>
#include <optional>

#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"
#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// Before the picture is sealed: its checksum covers this row.
absl::Status InsertView(SqliteFile* file, int64_t image_id, const JournalView& view);
// None: the picture was journalled before views were kept.
absl::StatusOr<std::optional<JournalView>> ReadView(SqliteFile* file, int64_t image_id);

}  // namespace touchstone::session
