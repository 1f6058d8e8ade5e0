// A file that is whole or absent: written beside its place as NAME.part, counted and hashed on the
// way, synced, then renamed. A crash, a kill or a full disk leaves at most a .part, which the next
// run writes anew.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::client {

inline constexpr char kPartSuffix[] = ".part";

struct FileDigest {
  uint64_t bytes = 0;
  std::string sha256;  // 64 hexadecimal digits
};

enum class Durability {
  kAlone,     // as described above
  kInFolder,  // part of a folder that is synced (SyncFileSystem) and renamed as a whole: written in place
};

class SyncedFile {
 public:
  // Opens `path`.part, or `path` itself in a folder of its own; empties what is there.
  static absl::StatusOr<std::unique_ptr<SyncedFile>> Create(const std::string& path,
                                                            Durability durability = Durability::kAlone);
  ~SyncedFile();  // without Commit: removes what was written

  // RESOURCE_EXHAUSTED if the disk is full.
  absl::Status Write(absl::string_view data);

  // Flushes, syncs, renames into place and syncs the folder.
  absl::StatusOr<FileDigest> Commit();

 private:
  SyncedFile() = default;
  absl::Status Flush();

  struct Hash;
  std::string path_;          // in the end
  std::string written_path_;  // until then
  Durability durability_ = Durability::kAlone;
  int descriptor_ = -1;
  std::string buffer_;
  uint64_t bytes_ = 0;
  std::unique_ptr<Hash> hash_;
};

// What went wrong with a path, from errno: the code and words for it ("... is full", "... may
// not be written").
absl::Status FileError(int error_number, const std::string& path, absl::string_view what);

// Renames and syncs the folder around, so that the new name survives a power cut.
absl::Status RenameSynced(const std::string& from, const std::string& to);

// Syncs a file or a folder that already stands.
absl::Status SyncPath(const std::string& path);

// Syncs everything on the file system that holds `path`: one call for a folder of many files.
absl::Status SyncFileSystem(const std::string& path);

}  // namespace touchstone::client
