// Opening a journal's file: whether it is one, and that only one process writes it. Internal to session/.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"
#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// Held while a journal is open for writing: FILE.lock, locked with flock, which ends with the process. The
// file stays.
class WriterLock {
 public:
  static absl::StatusOr<std::unique_ptr<WriterLock>> Take(const std::string& path);
  ~WriterLock();

 private:
  explicit WriterLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

struct OpenedJournal {
  std::unique_ptr<WriterLock> lock;  // null: for reading only
  std::unique_ptr<SqliteFile> file;  // closed first
  Journal::SkipDamaged skip_damaged;
};

absl::StatusOr<OpenedJournal> OpenJournalFile(const std::string& path, Journal::Mode mode);

}  // namespace touchstone::session
