// Checksums of rows, and the errors of rows that differ from theirs. Internal to session/journal.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// The first 64 bits of the SHA-256.
uint64_t ChecksumOf(absl::string_view bytes);

// Of the types and values of all rows of the queries, each of which has one place for `key`.
absl::StatusOr<uint64_t> Checksum(SqliteFile* file, std::initializer_list<const char*> queries, int64_t key);

// The session's name as far as it can be read, else its number.
std::string NameOfSession(SqliteFile* file, int64_t session_id);

// DATA_LOSS of the journal, with what helps.
absl::Status Damaged(const SqliteFile& file, absl::string_view what, absl::string_view remedy);

// What helps against a row that is damaged or missing.
std::string ExportTheRest(const SqliteFile& file, absl::string_view session);

}  // namespace touchstone::session
