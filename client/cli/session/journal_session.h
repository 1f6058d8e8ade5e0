// Sessions of a journal file (.db) on this computer, for the commands that take one in place of a server's.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/cli/common/common.h"
#include "client/source/dataset/measurement_csv.h"
#include "server/session/journal/journal.h"
#include "server/session/measurements/measurement_set.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::cli {

// Whether the user means a journal: the name ends in .db.
bool IsJournalPath(const std::string& text);

absl::StatusOr<std::unique_ptr<session::Journal>> OpenJournal(const std::string& path);  // to read

// The session of that name; with an empty name the only one. Errors list what there is; where there are several, `naming` is
// what the command takes to name one: "touchstone session verify FILE NAME" with FILE and NAME replaced. Empty: the command takes
// a file of one session alone.
absl::StatusOr<session::JournalSession> FindSession(const session::Journal& journal, const std::string& path,
                                                    const std::string& name, absl::string_view naming);

// The arguments NAME and SESSION of a command that takes a session of a server or of a journal. `what` says what NAME may be;
// `has_default`: the journal's only session needs no name.
struct SessionPlace {
  std::string name;
  std::string in_journal;  // the session's name where NAME is a journal
};
void AddSessionPlace(Cli* cli, CLI::App* command, SessionPlace* place, const std::string& what,
                     bool has_default);

// Its touches that are done, in the order in which they were made.
absl::StatusOr<std::vector<client::MeasuredTouch>> TouchesOf(const session::Journal& journal,
                                                             const std::string& session);

// What the journal's only session measured; `path` is its origin.
absl::StatusOr<session::MeasurementSet> JournalSet(const std::string& path);
// The photographs of the journal's only session, where it has no touch that is done; else none, and --quiet apart it is
// said that they are left out.
absl::StatusOr<std::optional<v1::ImageSetFiles>> JournalPhotographs(const Cli& cli, const std::string& path);
// The measurement file of a session.
absl::StatusOr<std::string> JournalCsv(const std::string& path, const std::string& session);

// Writes it to a file (.csv, .h5), to the folder of an image set where it has photographs, or to stdout (empty, "-": CSV);
// an existing file with --force only. Touches that are damaged are left out where `skip_damaged` is given, which is told
// each.
absl::Status ExportFromJournal(const Cli& cli, const std::string& path, const std::string& session,
                               const std::string& output,
                               session::Journal::SkipDamaged skip_damaged = nullptr);

// Makes a session out of a measurement file (.csv) or of what was exported (.h5), in a journal that may have
// others. Returns its number of touches.
absl::StatusOr<size_t> ImportIntoJournal(const std::string& file_path, const std::string& journal_path,
                                         const std::string& session);

}  // namespace touchstone::cli
