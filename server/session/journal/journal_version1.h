// Journals of version 1, which had no checksums. Internal to session/.
#pragma once

#include <absl/status/status.h>

#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// For reading only: its rows look as those of the present version do, and none of them is checked.
absl::Status ReadAsVersion1(SqliteFile* file);

// Makes it one of the present version, in one step: what is in it now gets checksums, whatever became of it before.
absl::Status MigrateFromVersion1(SqliteFile* file);

}  // namespace touchstone::session
