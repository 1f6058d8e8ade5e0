// Journals of version 2, whose pictures have no views. Internal to session/.
#pragma once

#include <absl/status/status.h>

#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// Makes a journal without the table image_view look as if it had an empty one; for reading only.
extern const char kNoViews[];

// For reading only. DATA_LOSS: it has what only a later version has, so that its number is damaged.
absl::Status ReadAsVersion2(SqliteFile* file);

// Makes it one of the present version, in one step. No row is changed: its checksums stay as they are.
absl::Status MigrateFromVersion2(SqliteFile* file);

}  // namespace touchstone::session
