#include "server/base/files/file_writer.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <random>
#include <utility>

#include "server/base/status.h"

namespace touchstone {
namespace {

constexpr size_t kMaxNameBytes = 200;  // of a name in one that is made from it; file systems allow 255
constexpr char kUnfinishedSuffix[] = ".part";

// `write`: of what is left, from `done` on.
template <typename Write>
absl::Status WriteRest(const std::string& path, absl::string_view data, size_t* written, Write write) {
  size_t done = 0;
  int error = 0;
  while (done < data.size() && error == 0) {
    const ssize_t count = write(data.substr(done), done);
    if (count > 0)
      done += static_cast<size_t>(count);
    else if (count == 0 || errno != EINTR)
      error = count == 0 ? EIO : errno;
  }
  if (written != nullptr) *written = done;
  return error == 0 ? absl::OkStatus() : FileError(error, path, "writing failed");
}

}  // namespace

absl::Status FileError(int error_number, const std::string& path, absl::string_view what) {
  const std::string message = absl::StrCat(path, ": ", what, ": ", std::strerror(error_number));
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return absl::ResourceExhaustedError(message);
    case EIO:
      return absl::DataLossError(message);
    default:
      return absl::InvalidArgumentError(message);
  }
}

absl::Status WriteAll(int descriptor, const std::string& path, absl::string_view data, size_t* written) {
  return WriteRest(path, data, written, [&](absl::string_view rest, size_t) {
    return ::write(descriptor, rest.data(), rest.size());
  });
}

absl::Status WriteAllAt(int descriptor, const std::string& path, uint64_t offset, absl::string_view data) {
  return WriteRest(path, data, nullptr, [&](absl::string_view rest, size_t done) {
    return ::pwrite(descriptor, rest.data(), rest.size(), static_cast<off_t>(offset + done));
  });
}

absl::Status SyncDescriptor(int descriptor, const std::string& path) {
  int failed = 0;
  do {
    failed = ::fsync(descriptor) == 0 ? 0 : errno;
  } while (failed == EINTR);
  if (failed == 0 || failed == EINVAL || failed == ENOTSUP) return absl::OkStatus();
  return FileError(failed, path, "cannot be synced");
}

int OpenFile(const std::string& path, int flags, mode_t mode) {
  int descriptor = -1;
  do {
    descriptor = ::open(path.c_str(), flags | O_CLOEXEC, mode);
  } while (descriptor < 0 && errno == EINTR);
  return descriptor;
}

absl::StatusOr<std::unique_ptr<FileWriter>> FileWriter::Create(const std::string& path, mode_t mode,
                                                               const std::string& called) {
  const int descriptor = OpenFile(path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW, mode);
  if (descriptor < 0) return FileError(errno, called.empty() ? path : called, "cannot be made");
  return std::unique_ptr<FileWriter>(new FileWriter(path, called.empty() ? path : called, descriptor));
}

FileWriter::~FileWriter() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(path_.c_str());
}

absl::Status FileWriter::Resize(uint64_t bytes) {
  int failed = 0;
  do {
    failed = ::ftruncate(descriptor_, static_cast<off_t>(bytes)) == 0 ? 0 : errno;
  } while (failed == EINTR);
  return failed == 0 ? absl::OkStatus() : FileError(failed, called_, "cannot be given its size");
}

absl::Status FileWriter::ReadAt(uint64_t offset, char* bytes, size_t size) const {
  while (size > 0) {
    const ssize_t count = ::pread(descriptor_, bytes, size, static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return FileError(errno, called_, "cannot be read again");
    if (count == 0) break;
    bytes += count, offset += static_cast<uint64_t>(count), size -= static_cast<size_t>(count);
  }
  std::memset(bytes, 0, size);
  return absl::OkStatus();
}

absl::Status FileWriter::Close(bool sync) {
  if (sync) TOUCHSTONE_RETURN_IF_ERROR(SyncDescriptor(descriptor_, called_));
  // Whatever close() says, the descriptor is gone: EINTR is no error (close(2)).
  if (::close(std::exchange(descriptor_, -1)) == 0 || errno == EINTR) return absl::OkStatus();
  const absl::Status failed = FileError(errno, called_, "closing failed");
  ::unlink(path_.c_str());
  return failed;
}

std::string UnfinishedPathOf(const std::string& path) {
  // Containers that share a folder have the same process numbers.
  static thread_local std::random_device random;
  const std::filesystem::path place(path);
  const std::string name = place.filename().string().substr(0, kMaxNameBytes);
  while (true) {
    const std::string free =
        (place.parent_path() /
         absl::StrCat(".", name, ".", absl::Hex(random(), absl::kZeroPad8), kUnfinishedSuffix))
            .string();
    struct stat info;
    if (::lstat(free.c_str(), &info) != 0) return free;
  }
}

bool IsUnfinishedName(absl::string_view name) {
  return absl::StartsWith(name, ".") && absl::EndsWith(name, kUnfinishedSuffix);
}

absl::Status WriteFileAtomically(const std::string& path, absl::string_view data, mode_t mode) {
  const std::string part = UnfinishedPathOf(path);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<FileWriter> file, FileWriter::Create(part, mode, path));
  TOUCHSTONE_RETURN_IF_ERROR(file->Write(data));
  TOUCHSTONE_RETURN_IF_ERROR(file->Close());
  const absl::Status renamed = RenameSynced(part, path);
  if (!renamed.ok()) ::unlink(part.c_str());
  return renamed;
}

absl::Status SyncFolderOf(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  // One that may be written and not read cannot be synced by its name.
  if (::access(folder.empty() ? "." : folder.c_str(), R_OK) != 0) return absl::OkStatus();
  return SyncPath(folder.empty() ? "." : folder);
}

absl::Status SyncPath(const std::string& path) {
  const int descriptor = OpenFile(path, O_RDONLY);
  if (descriptor < 0) return FileError(errno, path, "cannot be opened to be synced");
  const absl::Status synced = SyncDescriptor(descriptor, path);
  ::close(descriptor);
  return synced;
}

absl::Status RenameSynced(const std::string& from, const std::string& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0) return FileError(errno, to, "cannot be renamed into place");
  return SyncFolderOf(to);
}

}  // namespace touchstone
