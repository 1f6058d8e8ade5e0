#include "server/base/files/new_file.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <memory>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"

namespace touchstone {
namespace {

bool IsDraft(const std::string& name) {
  // As earlier versions named them, too.
  return IsUnfinishedName(name) || (absl::StartsWith(name, ".") && absl::EndsWith(name, ".draft"));
}

absl::Status WriteDraftAndLink(const std::string& path, absl::string_view data) {
  const std::string draft = UnfinishedPathOf(path);
  {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<FileWriter> file,
                                FileWriter::Create(draft, 0644, path));
    TOUCHSTONE_RETURN_IF_ERROR(file->Write(data));
    TOUCHSTONE_RETURN_IF_ERROR(file->Close());
  }
  const int error = ::link(draft.c_str(), path.c_str()) == 0 ? 0 : errno;
  ::unlink(draft.c_str());
  if (error == 0) return SyncFolderOf(path);
  if (error == EEXIST) return absl::AlreadyExistsError(path);
  // A file system without links: the race is lost to the last writer there.
  if (error == EPERM || error == EOPNOTSUPP || error == ENOSYS) return WriteFileAtomically(path, data);
  return FileError(error, path, "linking failed");
}

}  // namespace

absl::Status WriteNewFile(const std::string& path, absl::string_view data) {
  const absl::Status written = WriteDraftAndLink(path, data);
  // The folder is the server's: what is wrong with it is no mistake of who asks.
  if (written.ok() || absl::IsAlreadyExists(written) || absl::IsResourceExhausted(written)) return written;
  return absl::UnavailableError(written.message());
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
