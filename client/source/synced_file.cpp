#include "client/source/synced_file.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <openssl/evp.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "server/base/status.h"

namespace touchstone::client {
namespace {

constexpr size_t kBufferBytes = 1 << 20;

}  // namespace

struct SyncedFile::Hash {
  Hash() : context(EVP_MD_CTX_new()) { EVP_DigestInit_ex(context, EVP_sha256(), nullptr); }
  ~Hash() { EVP_MD_CTX_free(context); }
  std::string Hex() {
    unsigned char bytes[EVP_MAX_MD_SIZE];
    unsigned int size = 0;
    EVP_DigestFinal_ex(context, bytes, &size);
    std::string hex;
    for (unsigned int i = 0; i < size; ++i) absl::StrAppend(&hex, absl::Hex(bytes[i], absl::kZeroPad2));
    return hex;
  }
  EVP_MD_CTX* context;
};

absl::Status FileError(int error_number, const std::string& path, absl::string_view what) {
  const std::string message = absl::StrCat(path, ": ", what, ": ", std::strerror(error_number));
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
      return absl::ResourceExhaustedError(
          absl::StrCat(message, ". Make room and run the same command again: it resumes where it stopped"));
    case EIO:
      return absl::DataLossError(message);
    default:
      return absl::InvalidArgumentError(message);
  }
}

absl::Status SyncPath(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return FileError(errno, path, "cannot be opened to be synced");
  const int failed = ::fsync(descriptor) != 0 ? errno : 0;
  ::close(descriptor);
  // Some file systems do not sync folders; that is no error of ours.
  if (failed != 0 && failed != EINVAL && failed != ENOTSUP)
    return FileError(failed, path, "cannot be synced");
  return absl::OkStatus();
}

absl::Status RenameSynced(const std::string& from, const std::string& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0) return FileError(errno, to, "cannot be renamed into place");
  const std::string folder = std::filesystem::path(to).parent_path().string();
  return SyncPath(folder.empty() ? "." : folder);
}

absl::Status SyncFileSystem(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return FileError(errno, path, "cannot be opened to be synced");
  const int failed = ::syncfs(descriptor) != 0 ? errno : 0;
  ::close(descriptor);
  return failed == 0 ? absl::OkStatus() : FileError(failed, path, "cannot be synced");
}

absl::StatusOr<std::unique_ptr<SyncedFile>> SyncedFile::Create(const std::string& path,
                                                               Durability durability) {
  std::unique_ptr<SyncedFile> file(new SyncedFile);
  file->path_ = path;
  file->durability_ = durability;
  file->written_path_ = durability == Durability::kAlone ? path + kPartSuffix : path;
  file->descriptor_ = ::open(file->written_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file->descriptor_ < 0) return FileError(errno, path, "cannot be written");
  file->hash_ = std::make_unique<Hash>();
  return file;
}

SyncedFile::~SyncedFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(written_path_.c_str());
}

absl::Status SyncedFile::Write(absl::string_view data) {
  if (buffer_.size() + data.size() > kBufferBytes) TOUCHSTONE_RETURN_IF_ERROR(Flush());
  buffer_.append(data.data(), data.size());
  return buffer_.size() >= kBufferBytes ? Flush() : absl::OkStatus();
}

absl::Status SyncedFile::Flush() {
  size_t done = 0;
  while (done < buffer_.size()) {
    const ssize_t written = ::write(descriptor_, buffer_.data() + done, buffer_.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return FileError(errno, path_, "writing failed");
    done += static_cast<size_t>(written);
  }
  EVP_DigestUpdate(hash_->context, buffer_.data(), buffer_.size());
  bytes_ += buffer_.size();
  buffer_.clear();
  return absl::OkStatus();
}

absl::StatusOr<FileDigest> SyncedFile::Commit() {
  TOUCHSTONE_RETURN_IF_ERROR(Flush());
  if (durability_ == Durability::kAlone && ::fsync(descriptor_) != 0)
    return FileError(errno, path_, "cannot be synced");
  const int closed = ::close(descriptor_);
  descriptor_ = -1;
  if (closed != 0) return FileError(errno, path_, "closing failed");
  if (durability_ == Durability::kAlone) TOUCHSTONE_RETURN_IF_ERROR(RenameSynced(written_path_, path_));
  return FileDigest{bytes_, hash_->Hex()};
}

}  // namespace touchstone::client
