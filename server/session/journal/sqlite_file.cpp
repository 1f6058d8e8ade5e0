#include "server/session/journal/sqlite_file.h"

#include <absl/strings/str_cat.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>

namespace touchstone::session {

SqliteStatement::SqliteStatement(SqliteStatement&& other) noexcept
    : file_(other.file_), statement_(other.statement_), result_(other.result_), bound_(other.bound_) {
  other.statement_ = nullptr;
}

SqliteStatement::~SqliteStatement() {
  if (statement_ == nullptr) return;
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

SqliteStatement& SqliteStatement::Bind(double value) {
  if (statement_ != nullptr) Note(sqlite3_bind_double(statement_, ++bound_, value));
  return *this;
}

SqliteStatement& SqliteStatement::Bind(int64_t value) {
  if (statement_ != nullptr) Note(sqlite3_bind_int64(statement_, ++bound_, value));
  return *this;
}

SqliteStatement& SqliteStatement::Bind(absl::string_view text) {
  if (statement_ != nullptr)
    Note(sqlite3_bind_text64(statement_, ++bound_, text.empty() ? "" : text.data(), text.size(),
                             SQLITE_TRANSIENT, SQLITE_UTF8));
  return *this;
}

SqliteStatement& SqliteStatement::BindBlob(absl::string_view bytes) {
  if (statement_ != nullptr)
    Note(sqlite3_bind_blob64(statement_, ++bound_, bytes.empty() ? "" : bytes.data(), bytes.size(),
                             SQLITE_TRANSIENT));
  return *this;
}

SqliteStatement& SqliteStatement::BindNull() {
  if (statement_ != nullptr) Note(sqlite3_bind_null(statement_, ++bound_));
  return *this;
}

absl::StatusOr<bool> SqliteStatement::Step() {
  if (result_ != SQLITE_OK) return file_->Error(result_);
  errno = 0;
  const int result = sqlite3_step(statement_);
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  result_ = result;
  // Nothing writes such a row: it is damaged.
  if (result == SQLITE_TOOBIG) return absl::DataLossError(file_->Error(result).message());
  return file_->Error(result);
}

absl::Status SqliteStatement::Run() {
  while (true) {
    const absl::StatusOr<bool> row = Step();
    if (!row.ok()) return row.status();
    if (!*row) return absl::OkStatus();
  }
}

double SqliteStatement::Double(int column) const {
  return IsNull(column) ? std::numeric_limits<double>::quiet_NaN()
                        : sqlite3_column_double(statement_, column);
}

std::string SqliteStatement::Text(int column) const {
  const void* bytes = sqlite3_column_blob(statement_, column);
  return bytes == nullptr
             ? ""
             : std::string(static_cast<const char*>(bytes), sqlite3_column_bytes(statement_, column));
}

void SqliteStatement::AppendRow(absl::string_view except, std::string* bytes) const {
  const auto append = [&](const auto& value) {
    bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const int columns = sqlite3_column_count(statement_);
  for (int i = 0; i < columns; ++i) {
    if (except == sqlite3_column_name(statement_, i)) continue;
    const int type = sqlite3_column_type(statement_, i);
    bytes->push_back(static_cast<char>(type));
    if (type == SQLITE_INTEGER) append(sqlite3_column_int64(statement_, i));
    if (type == SQLITE_FLOAT) append(sqlite3_column_double(statement_, i));
    if (type != SQLITE_TEXT && type != SQLITE_BLOB) continue;
    const void* text = sqlite3_column_blob(statement_, i);
    const int64_t size = sqlite3_column_bytes(statement_, i);
    append(size);
    if (text != nullptr) bytes->append(static_cast<const char*>(text), static_cast<size_t>(size));
  }
}

SqliteSnapshot::SqliteSnapshot(SqliteFile* file)
    : file_(file), own_(sqlite3_get_autocommit(file->database_) != 0 && file->Run("BEGIN").ok()) {}

SqliteSnapshot::~SqliteSnapshot() {
  if (own_) sqlite3_exec(file_->database_, "COMMIT", nullptr, nullptr, nullptr);
}

absl::StatusOr<std::unique_ptr<SqliteFile>> SqliteFile::Open(const std::string& path, const std::string& name,
                                                             int flags) {
  sqlite3* database = nullptr;
  // The caller has a mutex of its own.
  const int result =
      sqlite3_open_v2(name.c_str(), &database, flags | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_URI, nullptr);
  std::unique_ptr<SqliteFile> file(new SqliteFile(path, database));
  if (result != SQLITE_OK) return file->Error(result);
  sqlite3_extended_result_codes(database, 1);
  sqlite3_busy_timeout(database, 5000);
  // Before there is memory for it.
  sqlite3_limit(database, SQLITE_LIMIT_LENGTH, kMaxValueBytes);
  return file;
}

SqliteFile::~SqliteFile() {
  for (const auto& [sql, statement] : prepared_) sqlite3_finalize(statement);
  sqlite3_close(database_);
}

SqliteStatement SqliteFile::Prepare(const char* sql) {
  const auto found = prepared_.find(sql);
  if (found != prepared_.end()) return SqliteStatement(this, found->second, SQLITE_OK);
  sqlite3_stmt* statement = nullptr;
  const int result = sqlite3_prepare_v3(database_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (result == SQLITE_OK) prepared_[sql] = statement;
  return SqliteStatement(this, statement, result);
}

absl::Status SqliteFile::Run(const char* sql) {
  errno = 0;
  const int result = sqlite3_exec(database_, sql, nullptr, nullptr, nullptr);
  return result == SQLITE_OK ? absl::OkStatus() : Error(result);
}

absl::StatusOr<int64_t> SqliteFile::Number(const char* sql) {
  SqliteStatement statement = Prepare(sql);
  const absl::StatusOr<bool> row = statement.Step();
  if (!row.ok()) return row.status();
  return *row ? statement.Integer(0) : 0;
}

absl::Status SqliteFile::CheckWritable() {
  if (sqlite3_db_readonly(database_, "main") == 1) return Error(SQLITE_READONLY);
  return Transact([] { return absl::OkStatus(); });
}

absl::Status SqliteFile::Error(int result) const {
  const int failed = errno;
  // SQLite keeps none of a COMMIT.
  int error = database_ == nullptr ? 0 : sqlite3_system_errno(database_);
  if (error == 0 && (result & 0xFF) == SQLITE_IOERR) error = failed;
  const auto message = [&](absl::string_view what, absl::string_view remedy) {
    return absl::StrCat("journal ", path_, " ", what, " (", sqlite3_errstr(result),
                        database_ == nullptr || sqlite3_errcode(database_) == SQLITE_OK
                            ? ""
                            : absl::StrCat(": ", sqlite3_errmsg(database_)),
                        error == 0 ? "" : absl::StrCat(", ", std::strerror(error)), "); ", remedy);
  };
  switch (result & 0xFF) {
    case SQLITE_NOTADB:
      return absl::InvalidArgumentError(message(
          "is no journal: it is not an SQLite file, or its beginning is damaged", "name another file"));
    case SQLITE_CORRUPT:
      return absl::DataLossError(message("is damaged", kRescueTheFile));
    case SQLITE_FULL:
      return absl::ResourceExhaustedError(
          message("cannot grow: its disk is full", "make room and try again"));
    case SQLITE_IOERR:
      // A full disk has a code of its own; a quota and the limit of a file's size have not.
      if (result == SQLITE_IOERR_WRITE)
        return absl::ResourceExhaustedError(
            message("cannot grow", "make room (disk, quota, limit of a file's size), or check its disk"));
      return absl::DataLossError(message("cannot be read or written", "check its disk"));
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_AUTH:
      return absl::PermissionDeniedError(
          message("may not be written",
                  "change the permissions of file and folder, check its disk, or copy it elsewhere"));
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return absl::UnavailableError(message("is in use by another program", "end that program or wait"));
    case SQLITE_CANTOPEN:
      return absl::NotFoundError(
          message("cannot be opened",
                  "check that the folder is there and that file and folder may be read and written"));
    case SQLITE_TOOBIG:
      return absl::InvalidArgumentError(message(
          absl::StrCat("holds values of at most ", kMaxValueBytes >> 20, " MiB"), "make this one smaller"));
    case SQLITE_NOMEM:
      return absl::ResourceExhaustedError(
          message("needs more memory than there is", "give this program more, or wait"));
    default:
      return absl::InternalError(message("failed", "this is a mistake of this program"));
  }
}

}  // namespace touchstone::session
