// The journal's own row: how many sessions there are, and its facts (what is true of the rig and of no session) with the sum of
// their checksums. Internal to session/journal.
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

absl::Status InsertHead(SqliteFile* file);
absl::Status AddToSessionCount(SqliteFile* file, int64_t change);
absl::Status CheckSessionCount(SqliteFile* file);

absl::Status WriteFact(SqliteFile* file, const std::string& key, const std::string& value);
absl::StatusOr<std::string> ReadFact(SqliteFile* file, const std::string& key);  // "" if it is not there

}  // namespace touchstone::session
