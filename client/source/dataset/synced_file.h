// A file that is whole or absent: written beside its place as NAME.part, counted and hashed on the
// way, synced, then renamed. A crash, a kill or a full disk leaves at most a .part, which the next
// run writes anew.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/base/files/file_writer.h"
#include "server/base/text/sha256.h"

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
  // Makes `path`.part, or `path` itself in a folder of its own, in place of what is there.
  static absl::StatusOr<std::unique_ptr<SyncedFile>> Create(const std::string& path,
                                                            Durability durability = Durability::kAlone);
  ~SyncedFile();  // without Commit: what was written is removed

  // RESOURCE_EXHAUSTED if the disk is full.
  absl::Status Write(absl::string_view data);

  // Flushes, syncs, renames into place and syncs the folder.
  absl::StatusOr<FileDigest> Commit();

 private:
  SyncedFile() = default;
  absl::Status Flush();

  std::string path_;          // in the end
  std::string written_path_;  // until then
  Durability durability_ = Durability::kAlone;
  std::unique_ptr<FileWriter> file_;
  std::string buffer_;
  uint64_t bytes_ = 0;
  Sha256 hash_;
};

// An error of a shard's file; where there was no room it says how to go on.
absl::Status TellToResume(const absl::Status& failed);

// Makes a file that is written under a name for what is not finished, in place of what a killed run left there; `called`: as
// messages name it. And renames what is finished; what cannot be is removed.
absl::StatusOr<std::unique_ptr<FileWriter>> ReplaceUnfinished(const std::string& part,
                                                              const std::string& called);
absl::Status RenameUnfinished(const std::string& part, const std::string& path);

// Syncs everything on the file system that holds `path`: one call for a folder of many files.
absl::Status SyncFileSystem(const std::string& path);

}  // namespace touchstone::client
