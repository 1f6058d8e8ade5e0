#include "client/source/dataset/synced_file.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>

#include "server/base/status.h"

namespace touchstone::client {
namespace {

constexpr size_t kBufferBytes = 1 << 20;

}  // namespace

absl::Status TellToResume(const absl::Status& failed) {
  if (!absl::IsResourceExhausted(failed)) return failed;
  return absl::ResourceExhaustedError(absl::StrCat(
      failed.message(), ". Make room and run the same command again: it resumes where it stopped"));
}

absl::Status SyncFileSystem(const std::string& path) {
  const int descriptor = OpenFile(path, O_RDONLY);
  if (descriptor < 0) return FileError(errno, path, "cannot be opened to be synced");
  const int failed = ::syncfs(descriptor) != 0 ? errno : 0;
  ::close(descriptor);
  return failed == 0 ? absl::OkStatus() : TellToResume(FileError(failed, path, "cannot be synced"));
}

absl::StatusOr<std::unique_ptr<SyncedFile>> SyncedFile::Create(const std::string& path,
                                                               Durability durability) {
  std::unique_ptr<SyncedFile> file(new SyncedFile);
  file->path_ = path;
  file->durability_ = durability;
  file->written_path_ = durability == Durability::kAlone ? path + kPartSuffix : path;
  TOUCHSTONE_ASSIGN_OR_RETURN(file->file_, ReplaceUnfinished(file->written_path_, path));
  return file;
}

SyncedFile::~SyncedFile() = default;

absl::StatusOr<std::unique_ptr<FileWriter>> ReplaceUnfinished(const std::string& part,
                                                              const std::string& called) {
  ::unlink(part.c_str());
  absl::StatusOr<std::unique_ptr<FileWriter>> file = FileWriter::Create(part, 0666, called);
  if (!file.ok()) return TellToResume(file.status());
  return file;
}

absl::Status SyncedFile::Write(absl::string_view data) {
  if (buffer_.size() + data.size() > kBufferBytes) TOUCHSTONE_RETURN_IF_ERROR(Flush());
  buffer_.append(data.data(), data.size());
  return buffer_.size() >= kBufferBytes ? Flush() : absl::OkStatus();
}

absl::Status SyncedFile::Flush() {
  TOUCHSTONE_RETURN_IF_ERROR(TellToResume(file_->Write(buffer_)));
  hash_.Add({buffer_.data(), buffer_.size()});
  bytes_ += buffer_.size();
  buffer_.clear();
  return absl::OkStatus();
}

absl::StatusOr<FileDigest> SyncedFile::Commit() {
  TOUCHSTONE_RETURN_IF_ERROR(Flush());
  TOUCHSTONE_RETURN_IF_ERROR(TellToResume(file_->Close(/*sync=*/durability_ == Durability::kAlone)));
  if (durability_ == Durability::kAlone) TOUCHSTONE_RETURN_IF_ERROR(RenameUnfinished(written_path_, path_));
  return FileDigest{bytes_, hash_.Hex()};
}

absl::Status RenameUnfinished(const std::string& part, const std::string& path) {
  const absl::Status renamed = RenameSynced(part, path);
  if (renamed.ok()) return renamed;
  std::error_code ignored;
  if (::unlink(part.c_str()) != 0) std::filesystem::remove_all(part, ignored);
  return TellToResume(renamed);
}

}  // namespace touchstone::client
