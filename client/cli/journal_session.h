// Sessions of a journal file (.db) on this computer, for the commands that take one in place of a server's.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/measurement_csv.h"
#include "server/session/journal.h"
#include "server/session/measurement_set.h"

namespace touchstone::cli {

// Whether the user means a journal: the name ends in .db.
bool IsJournalPath(const std::string& text);

absl::StatusOr<std::unique_ptr<session::Journal>> OpenJournal(const std::string& path);  // to read

// The session of that name; with an empty name the only one. Errors list what there is.
absl::StatusOr<session::JournalSession> FindSession(const session::Journal& journal, const std::string& path,
                                                    const std::string& name);

// Its touches that are done, in the order in which they were made.
absl::StatusOr<std::vector<client::MeasuredTouch>> TouchesOf(const session::Journal& journal,
                                                             const std::string& session);

// What the journal's only session measured; `path` is its origin.
absl::StatusOr<session::MeasurementSet> JournalSet(const std::string& path);
// The measurement file of a session.
absl::StatusOr<std::string> JournalCsv(const std::string& path, const std::string& session);

// Writes it to a file (.csv, .h5) or to stdout (empty, "-": CSV); an existing file with `force` only. Touches that
// are damaged are left out where `skip_damaged` is given, which is told each.
absl::Status ExportFromJournal(const std::string& path, const std::string& session, const std::string& output,
                               bool force, session::Journal::SkipDamaged skip_damaged = nullptr);

// Makes a session out of a measurement file (.csv) or of what was exported (.h5), in a journal that may have
// others. Returns its number of touches.
absl::StatusOr<size_t> ImportIntoJournal(const std::string& file_path, const std::string& journal_path,
                                         const std::string& session);

}  // namespace touchstone::cli
