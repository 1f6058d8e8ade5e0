// The one place where programs make files: whole or absent, whatever call of the system fails. SQLite (journals) has a seam
// of its own; HDF5 writes through this one (session/hdf5/hdf5_driver.h). tests/faults/preloaded/failing_files.cpp fails every call in turn.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone {

// What went wrong with a path, from errno: RESOURCE_EXHAUSTED where there is no room (disk, quota, limit of a file's size),
// DATA_LOSS where the disk fails, else INVALID_ARGUMENT.
absl::Status FileError(int error_number, const std::string& path, absl::string_view what);

// Writes all of it to an open file, however often that takes. `written`: how much of it was, if that is asked for.
absl::Status WriteAll(int descriptor, const std::string& path, absl::string_view data,
                      size_t* written = nullptr);
absl::Status WriteAllAt(int descriptor, const std::string& path, uint64_t offset, absl::string_view data);
// To the disk. Folders and pipes of some file systems cannot be synced; that is no error of ours.
absl::Status SyncDescriptor(int descriptor, const std::string& path);

// open() again where a signal interrupted it; close-on-exec. Below 0: errno.
int OpenFile(const std::string& path, int flags, mode_t mode = 0);

// A file that is being made, under a name that nothing had: nothing is written through a link that stands there. Removed
// unless it was closed without an error.
class FileWriter {
 public:
  // `mode`: permission bits, of which the umask takes some. `called`: its name in messages, if not `path`.
  static absl::StatusOr<std::unique_ptr<FileWriter>> Create(const std::string& path, mode_t mode = 0666,
                                                            const std::string& called = "");
  ~FileWriter();
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  absl::Status Write(absl::string_view data) { return WriteAll(descriptor_, called_, data); }
  absl::Status WriteAt(uint64_t offset, absl::string_view data) {
    return WriteAllAt(descriptor_, called_, offset, data);
  }
  absl::Status Resize(uint64_t bytes);
  // The bytes from `offset` on that are there; beyond the end zeros.
  absl::Status ReadAt(uint64_t offset, char* bytes, size_t size) const;
  // Syncs unless told otherwise, and closes.
  absl::Status Close(bool sync = true);

 private:
  FileWriter(std::string path, std::string called, int descriptor)
      : path_(std::move(path)), called_(std::move(called)), descriptor_(descriptor) {}

  const std::string path_, called_;
  int descriptor_;
};

// A hidden name beside `path` that nothing has, for what is renamed to it: FOLDER/.NAME.HEX.part.
std::string UnfinishedPathOf(const std::string& path);
// Whether a name in a folder is such a one, which a killed program left.
bool IsUnfinishedName(absl::string_view name);

// Writes beside `path`, syncs, then renames: the file is whole, or what stood there before stays.
absl::Status WriteFileAtomically(const std::string& path, absl::string_view data, mode_t mode = 0644);

// Makes the name of a file that was written, linked or renamed outlive a power cut, by syncing its folder.
absl::Status SyncFolderOf(const std::string& path);
// Syncs a file or folder that already stands.
absl::Status SyncPath(const std::string& path);
// Renames a file or folder that is synced, and syncs the folder around.
absl::Status RenameSynced(const std::string& from, const std::string& to);

}  // namespace touchstone
