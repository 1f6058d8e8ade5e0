#include "server/base/new_file.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <random>

#include "server/base/status.h"
#include "server/base/text.h"

namespace touchstone {
namespace {

constexpr char kDraftSuffix[] = ".draft";

// Containers that share a folder have the same process numbers.
std::string DraftOf(const std::string& path) {
  static thread_local std::random_device random;
  const std::filesystem::path place(path);
  const std::string name =
      absl::StrCat(".", place.filename().string(), ".", absl::Hex(random()), absl::Hex(random()));
  return (place.parent_path() / absl::StrCat(name, kDraftSuffix)).string();
}

bool IsDraft(const std::string& name) {
  return absl::StartsWith(name, ".") &&
         (absl::EndsWith(name, kDraftSuffix) || absl::EndsWith(name, absl::StrCat(kDraftSuffix, ".part")));
}

}  // namespace

absl::Status WriteNewFile(const std::string& path, absl::string_view data) {
  const std::string draft = DraftOf(path);
  TOUCHSTONE_RETURN_IF_ERROR(WriteFileAtomically(draft, data));
  const int error = ::link(draft.c_str(), path.c_str()) == 0 ? 0 : errno;
  ::unlink(draft.c_str());
  if (error == 0) return SyncFolderOf(path);
  if (error == EEXIST) return absl::AlreadyExistsError(path);
  // A file system without links: the race is lost to the last writer there.
  if (error == EPERM || error == EOPNOTSUPP || error == ENOSYS) return WriteFileAtomically(path, data);
  return absl::UnavailableError(absl::StrCat(path, ": linking failed: ", std::strerror(error)));
}

// Some file systems do not sync folders; that is no error of ours.
absl::Status SyncFolderOf(const std::string& path) {
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const int error = descriptor < 0 || ::fsync(descriptor) != 0 ? errno : 0;
  if (descriptor >= 0) ::close(descriptor);
  if (error == 0 || error == EINVAL || error == ENOTSUP) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(folder, ": syncing the folder failed: ", std::strerror(error)));
}

void RemoveOldDrafts(const std::string& folder, std::chrono::seconds age) {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (!IsDraft(entry.path().filename().string())) continue;
    const auto written = std::filesystem::last_write_time(entry.path(), error);
    if (!error && std::filesystem::file_time_type::clock::now() - written >= age)
      std::filesystem::remove(entry.path(), error);
  }
}

}  // namespace touchstone
