// An SQLite file with statements that are prepared once, and errors that name the file and what to do.
// Internal to session/. Not thread-safe.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::session {

// What helps when SQLite itself finds a file damaged. Debian's sqlite3 knows .recover, but fails at it (3.40.1 says
// "SQL logic error": it lacks the table sqlite_dbpage).
inline constexpr char kRescueTheFile[] =
    "keep a copy, then write what is whole with: touchstone session export FILE SESSION --skip-damaged -o "
    "rest.h5; a "
    "sqlite3 of sqlite.org also has: sqlite3 FILE .recover | sqlite3 NEW";

// Of a value or a row of a journal, written or read: a picture has at most 32 MiB.
inline constexpr int kMaxValueBytes = 64 << 20;

class SqliteFile;

// A statement in use: bind what its question marks stand for, in their order, then step or run. Given back
// for the next use when it goes out of scope. The first thing that goes wrong is what Step and Run return.
class SqliteStatement {
 public:
  SqliteStatement(SqliteStatement&& other) noexcept;
  SqliteStatement& operator=(SqliteStatement&&) = delete;
  ~SqliteStatement();

  SqliteStatement& Bind(double value);  // NaN is written as NULL
  SqliteStatement& Bind(int64_t value);
  SqliteStatement& Bind(absl::string_view text);
  SqliteStatement& BindBlob(absl::string_view bytes);
  SqliteStatement& BindNull();

  // True: a row is there to be read; false: no more.
  absl::StatusOr<bool> Step();
  // To the end; for statements that give no rows.
  absl::Status Run();

  double Double(int column) const;  // NULL is NaN
  int64_t Integer(int column) const { return sqlite3_column_int64(statement_, column); }
  bool IsNull(int column) const { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
  std::string Text(int column) const;  // or a blob
  // The row's types and values, but for the column of this name: equal rows give equal bytes.
  void AppendRow(absl::string_view except, std::string* bytes) const;

 private:
  friend class SqliteFile;
  SqliteStatement(SqliteFile* file, sqlite3_stmt* statement, int result)
      : file_(file), statement_(statement), result_(result) {}
  void Note(int result) {
    if (result_ == SQLITE_OK) result_ = result;
  }

  SqliteFile* file_;
  sqlite3_stmt* statement_;
  int result_;
  int bound_ = 0;
};

class SqliteFile {
 public:
  // `path` is what messages call it; `name` what SQLite opens (a path or a file: URI); `flags` are
  // sqlite3_open_v2's.
  static absl::StatusOr<std::unique_ptr<SqliteFile>> Open(const std::string& path, const std::string& name,
                                                          int flags);
  ~SqliteFile();

  // `sql` must outlive the file: a literal.
  SqliteStatement Prepare(const char* sql);
  // One or several statements without parameters or rows.
  absl::Status Run(const char* sql);
  // The first number that a query gives.
  absl::StatusOr<int64_t> Number(const char* sql);

  // BEGIN IMMEDIATE, `work`, COMMIT; rolled back if any of them fails.
  template <typename Work>
  absl::Status Transact(Work work) {
    if (absl::Status status = Run("BEGIN IMMEDIATE"); !status.ok()) return status;
    absl::Status status = work();
    if (status.ok()) status = Run("COMMIT");
    // A failed write may have rolled back by itself.
    if (!status.ok() && !sqlite3_get_autocommit(database_))
      sqlite3_exec(database_, "ROLLBACK", nullptr, nullptr, nullptr);
    return status;
  }

  // A file (or its WAL) that the disk once refused to open for writing, SQLite opens for reading only, and does not say so.
  absl::Status CheckWritable();

  // Whether its rows carry checksums; true unless said otherwise.
  bool has_checksums() const { return has_checksums_; }
  void set_has_checksums(bool has) { has_checksums_ = has; }

  // The error of the call that just failed.
  absl::Status Error(int result) const;
  const std::string& path() const { return path_; }

 private:
  friend class SqliteSnapshot;
  SqliteFile(std::string path, sqlite3* database) : path_(std::move(path)), database_(database) {}

  const std::string path_;
  sqlite3* database_;
  std::map<const char*, sqlite3_stmt*> prepared_;
  bool has_checksums_ = true;
};

// While it lives, everything is read as it stood at the first reading; within a transaction it changes nothing.
class SqliteSnapshot {
 public:
  explicit SqliteSnapshot(SqliteFile* file);
  ~SqliteSnapshot();
  SqliteSnapshot(const SqliteSnapshot&) = delete;
  SqliteSnapshot& operator=(const SqliteSnapshot&) = delete;

 private:
  SqliteFile* const file_;
  const bool own_;
};

}  // namespace touchstone::session
