#include "server/session/journal/journal_open.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <map>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/session/journal/journal_head.h"
#include "server/session/journal/journal_schema.h"
#include "server/session/journal/journal_seal.h"
#include "server/session/journal/journal_version1.h"
#include "server/session/journal/journal_version2.h"

namespace touchstone::session {
namespace {

bool IsThere(const std::string& path) {
  struct stat facts {};
  return stat(path.c_str(), &facts) == 0;
}

// A relative path could be one of SQLite's special names.
std::string PlainName(const std::string& path) {
  return path[0] == '/' ? path : "./" + path;
}

// The URI of a file that nobody writes: neither locks nor a file beside it are needed.
std::string ImmutableUri(const std::string& path) {
  std::string uri = "file:";
  for (const unsigned char c : PlainName(path)) {
    if (c == '?' || c == '#' || c == '%' || c <= ' ' || c >= 0x7F)
      absl::StrAppendFormat(&uri, "%%%02x", c);
    else
      uri += static_cast<char>(c);
  }
  return uri + "?immutable=1";
}

absl::StatusOr<std::unique_ptr<SqliteFile>> OpenForReading(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<SqliteFile> file,
                              SqliteFile::Open(path, PlainName(path), SQLITE_OPEN_READONLY));
  // In a folder that may not be written, SQLite cannot make its shared memory; without a log it needs none.
  const absl::Status readable = file->Number("PRAGMA schema_version").status();
  struct stat log {};
  const bool has_log = stat((path + "-wal").c_str(), &log) == 0 && log.st_size > 0;
  if (readable.ok() || has_log || absl::IsInvalidArgument(readable) || absl::IsDataLoss(readable)) {
    if (!readable.ok()) return readable;
    return file;
  }
  return SqliteFile::Open(path, ImmutableUri(path), SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
}

absl::Status MakeTables(SqliteFile* file) {
  return file->Transact([&]() -> absl::Status {
    TOUCHSTONE_RETURN_IF_ERROR(file->Run(kJournalSchema));
    TOUCHSTONE_RETURN_IF_ERROR(file->Run(kViewSchema));
    TOUCHSTONE_RETURN_IF_ERROR(InsertHead(file));
    static const std::string identity = absl::StrCat("PRAGMA application_id = ", kJournalApplicationId,
                                                     "; PRAGMA user_version = ", kJournalVersion);
    return file->Run(identity.c_str());
  });
}

// A new journal, whole or not there: what fails halfway through would leave a file that reads as damaged.
absl::Status MakeJournal(const std::string& path) {
  const std::string part = UnfinishedPathOf(path);
  const auto make = [&]() -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::unique_ptr<SqliteFile> file,
        SqliteFile::Open(path, PlainName(part), SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE));
    return MakeTables(file.get());
  };
  absl::Status made = make();
  if (made.ok()) made = RenameSynced(part, path);
  if (!made.ok())
    for (const char* suffix : {"", "-journal"}) unlink((part + suffix).c_str());
  return made;
}

// Whether the file is a journal of a version that can be read, which is returned; an empty one may become one.
absl::StatusOr<int64_t> CheckIdentity(SqliteFile* file, bool may_create) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t application, file->Number("PRAGMA application_id"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t version, file->Number("PRAGMA user_version"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t tables, file->Number("SELECT count(*) FROM main.sqlite_master"));
  const std::string& path = file->path();
  if (application == 0 && version == 0 && tables == 0) {
    if (!may_create)
      return absl::InvalidArgumentError(
          absl::StrCat("journal ", path, " is empty; name one that a gateway or an export has written"));
    TOUCHSTONE_RETURN_IF_ERROR(MakeTables(file));
    return kJournalVersion;
  }
  if (application != kJournalApplicationId)
    return absl::InvalidArgumentError(absl::StrCat(
        "journal ", path, " is no journal but another program's SQLite file; name another file"));
  if (version < 1 || version > kJournalVersion)
    return absl::FailedPreconditionError(absl::StrCat(
        "journal ", path, " is of version ", version, "; this program reads versions 1 to ", kJournalVersion,
        version > kJournalVersion ? ": use the newer program that wrote it"
                                  : ": there was none, so its beginning is damaged; keep a copy"));
  return version;
}

// The tables are those that a journal of this version has: a damaged schema could exchange columns.
absl::Status CheckTables(SqliteFile* file, int64_t version) {
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const std::unique_ptr<SqliteFile> whole,
      SqliteFile::Open("schema", ":memory:", SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE));
  TOUCHSTONE_RETURN_IF_ERROR(whole->Run(kJournalSchema));
  if (version > 2) TOUCHSTONE_RETURN_IF_ERROR(whole->Run(kViewSchema));
  const char* const query = "SELECT name, sql FROM main.sqlite_master WHERE sql IS NOT NULL";
  std::map<std::string, std::string> found;
  SqliteStatement rows = file->Prepare(query);
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool more, rows.Step());
    if (!more) break;
    found[rows.Text(0)] = rows.Text(1);
  }
  SqliteStatement expected = whole->Prepare(query);
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool more, expected.Step());
    if (!more) return absl::OkStatus();
    if (found[expected.Text(0)] != expected.Text(1))
      return absl::DataLossError(absl::StrCat("journal ", file->path(), " is damaged: its table '",
                                              expected.Text(0), "' is not that of version ", version, "; ",
                                              kRescueTheFile));
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<WriterLock>> WriterLock::Take(const std::string& path) {
  const std::string lock_path = path + ".lock";
  // Never through a link that somebody put there: the number below is written into it.
  const int descriptor = OpenFile(lock_path, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK, 0666);
  struct stat facts {};
  if (descriptor < 0 ? errno == ELOOP
                     : fstat(descriptor, &facts) != 0 || !S_ISREG(facts.st_mode) || facts.st_nlink > 1) {
    if (descriptor >= 0) close(descriptor);
    return absl::PermissionDeniedError(
        absl::StrCat("journal ", path, " may not be written: ", lock_path,
                     " is a link or no file of its own; remove it, or name a file in a folder of your own"));
  }
  if (descriptor < 0)
    return absl::PermissionDeniedError(absl::StrCat(
        "journal ", path, " may not be written: ", lock_path, " cannot be made (", std::strerror(errno),
        "); name a file in a folder that is there and may be written, or open it for reading only"));
  std::unique_ptr<WriterLock> lock(new WriterLock(descriptor));
  char writer[32] = {};
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    const ssize_t length = pread(descriptor, writer, sizeof writer - 1, 0);
    return absl::FailedPreconditionError(
        absl::StrCat("journal ", path, " is open for writing by process ", length > 0 ? writer : "(unknown)",
                     "; one gateway writes a journal: end that process, or name another file"));
  }
  // Who it is, for that message.
  const std::string process = std::to_string(getpid());
  if (ftruncate(descriptor, 0) == 0 &&
      pwrite(descriptor, process.data(), process.size(), 0) != static_cast<ssize_t>(process.size()))
    (void)ftruncate(descriptor, 0);
  return lock;
}

WriterLock::~WriterLock() {
  close(descriptor_);
}

absl::StatusOr<OpenedJournal> OpenJournalFile(const std::string& path, Journal::Mode mode) {
  if (path.empty()) return absl::InvalidArgumentError("a journal needs a file name, for example session.db");
  const bool may_create = mode == Journal::Mode::kCreateOrReadWrite;
  if (!may_create && !IsThere(path))
    return absl::NotFoundError(
        absl::StrCat("journal ", path, ": there is no such file (", std::strerror(errno), ")"));
  OpenedJournal opened;
  if (mode == Journal::Mode::kReadOnly) {
    TOUCHSTONE_ASSIGN_OR_RETURN(opened.file, OpenForReading(path));
    TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t version, CheckIdentity(opened.file.get(), false));
    if (version > 1) TOUCHSTONE_RETURN_IF_ERROR(CheckTables(opened.file.get(), version));
    if (version == 1) TOUCHSTONE_RETURN_IF_ERROR(ReadAsVersion1(opened.file.get()));
    if (version == 2) TOUCHSTONE_RETURN_IF_ERROR(ReadAsVersion2(opened.file.get()));
    return opened;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(opened.lock, WriterLock::Take(path));
  if (!IsThere(path)) TOUCHSTONE_RETURN_IF_ERROR(MakeJournal(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      opened.file,
      SqliteFile::Open(path, PlainName(path), SQLITE_OPEN_READWRITE | (may_create ? SQLITE_OPEN_CREATE : 0)));
  SqliteFile& file = *opened.file;
  // Before the first write: another program's file is left as it is. SQLite opens a write-protected file all
  // the same.
  TOUCHSTONE_RETURN_IF_ERROR(file.Number("PRAGMA schema_version").status());
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t version, CheckIdentity(&file, may_create));
  if (access(path.c_str(), W_OK) != 0)
    return absl::PermissionDeniedError(
        absl::StrCat("journal ", path, " may not be written (", std::strerror(errno),
                     "); change its permissions, or open it for reading only"));
  TOUCHSTONE_RETURN_IF_ERROR(file.Run("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL"));
  {
    // With the indices: a touch that they have lost would be made again under its id.
    SqliteStatement check = file.Prepare("PRAGMA integrity_check(1)");
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool has_row, check.Step());
    if (has_row && check.Text(0) != "ok")
      return absl::DataLossError(
          absl::StrCat("journal ", path, " is damaged (", check.Text(0), "); ", kRescueTheFile));
  }
  if (version == 1) {
    TOUCHSTONE_RETURN_IF_ERROR(MigrateFromVersion1(&file));
  }
  if (version == 2) {
    TOUCHSTONE_RETURN_IF_ERROR(CheckTables(&file, version));
    TOUCHSTONE_RETURN_IF_ERROR(MigrateFromVersion2(&file));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckTables(&file, kJournalVersion));
  TOUCHSTONE_RETURN_IF_ERROR(CheckSessionCount(&file));
  TOUCHSTONE_RETURN_IF_ERROR(file.CheckWritable());
  return opened;
}

}  // namespace touchstone::session
