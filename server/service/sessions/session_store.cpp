#include "server/service/sessions/session_store.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "server/base/files/file_writer.h"
#include "server/base/files/new_file.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/source/request_checks.h"

namespace touchstone::service {
namespace {

// A measurement file under one, an image set under the other.
constexpr char kCsvExtension[] = ".csv", kImagesExtension[] = ".images";
constexpr size_t kMaxSessions = 10000;

uint64_t Mebibytes(int count) {
  return static_cast<uint64_t>(count) << 20;
}

}  // namespace

absl::StatusOr<std::unique_ptr<SessionStore>> SessionStore::Open(const ServerOptions& options) {
  auto store = std::make_unique<SessionStore>();
  store->folder_ = options.sessions_dir;
  store->limits_ = options.OfMeasurements();
  store->max_bytes_ = Mebibytes(options.max_session_mib);
  store->max_bytes_together_ = Mebibytes(options.max_sessions_mib);
  if (store->folder_.empty()) return store;
  std::error_code error;
  std::filesystem::create_directories(store->folder_, error);
  if (error)
    return absl::InvalidArgumentError(
        absl::StrCat("sessions_dir: ", store->folder_, ": ", error.message(), "; a folder was expected"));
  RemoveOldDrafts(store->folder_, kOldDraft);
  return store;
}

absl::Status SessionStore::Upload::Append(const std::string& file, absl::string_view piece) {
  if (pieces_.bytes() + piece.size() > store_->max_bytes_)
    return absl::ResourceExhaustedError(
        absl::StrCat("csv: more than ", pieces_.bytes() >> 20, " MiB: a session may have at most ",
                     store_->max_bytes_ >> 20, " MiB (max_session_mib); divide it by object"));
  counted_ += piece.size();
  const uint64_t uploading = store_->uploading_ += piece.size();
  TOUCHSTONE_RETURN_IF_ERROR(pieces_.Append(file, piece));
  if (uploading > store_->max_bytes_together_)
    return absl::ResourceExhaustedError(
        absl::StrCat("more than ", store_->max_bytes_together_ >> 20,
                     " MiB of sessions are being sent at once (max_sessions_mib): try again"));
  return absl::OkStatus();
}

absl::Status SessionStore::CheckName(const std::string& name) {
  return source::CheckResourceName(name, "name");
}

std::string SessionStore::PathOf(const std::string& name, bool images) const {
  return absl::StrCat(folder_, "/", name, images ? kImagesExtension : kCsvExtension);
}

bool SessionStore::Stat(const std::string& name, Version* version, std::string* path) const {
  for (const bool images : {false, true}) {
    const std::string file = PathOf(name, images);
    struct stat info;
    if (::stat(file.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) continue;
    constexpr int64_t kNanosecondsPerSecond = 1'000'000'000;
    version->modified_ns = info.st_mtim.tv_sec * kNanosecondsPerSecond + info.st_mtim.tv_nsec;
    version->bytes = info.st_size;
    version->inode = info.st_ino;
    if (path != nullptr) *path = file;
    return true;
  }
  return false;
}

std::vector<std::string> SessionStore::Names() const {
  std::vector<std::string> names;
  if (folder_.empty()) {
    std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [name, known] : known_) names.push_back(name);
    return names;
  }
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, error)) {
    const std::string file = entry.path().filename().string();
    for (const char* extension : {kCsvExtension, kImagesExtension}) {
      if (!absl::EndsWith(file, extension)) continue;
      std::string name = file.substr(0, file.size() - std::strlen(extension));
      if (CheckName(name).ok()) names.push_back(std::move(name));
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

SessionStore::Usage SessionStore::Stored() const {
  Usage usage;
  if (folder_.empty()) {
    usage.sessions = known_.size();
    for (const auto& [name, known] : known_) usage.bytes += known.bytes->size();
    return usage;
  }
  Version version;
  for (const std::string& name : Names())
    if (Stat(name, &version)) {
      ++usage.sessions;
      usage.bytes += version.bytes;
    }
  return usage;
}

absl::Status SessionStore::NoSession(const std::string& name) const {
  return absl::NotFoundError(absl::StrCat("no session is named '", name, "'", DidYouMean(name, Names())));
}

absl::StatusOr<v1::Session> SessionStore::Find(const std::string& name) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckName(name));
  Version version;
  std::string path;
  const bool stored = folder_.empty() || Stat(name, &version, &path);
  {
    std::lock_guard<std::mutex> lock(mutex_);
    const auto found = known_.find(name);
    if (stored && found != known_.end() && found->second.version == version) return found->second.session;
  }
  if (folder_.empty() || !stored) return NoSession(name);
  // Another replica wrote it, or this one before it was started anew.
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::Session session, DescribeSession(name, bytes, name));
  std::lock_guard<std::mutex> lock(mutex_);
  Known& known = known_[name];
  known.session = session;
  known.version = version;
  return session;
}

// Never over another one: two replicas may be given the same name at once.
absl::Status SessionStore::WriteNew(const std::string& name, const std::string& bytes) const {
  const bool images = HoldsImages(bytes);
  const std::string path = PathOf(name, images), other = PathOf(name, !images);
  TOUCHSTONE_RETURN_IF_ERROR(WriteNewFile(path, bytes));
  // A session of the other kind came at the same moment: neither writes over the other, and this one steps back.
  if (::access(other.c_str(), F_OK) != 0) return absl::OkStatus();
  ::unlink(path.c_str());
  return absl::AlreadyExistsError(other);
}

absl::StatusOr<v1::Session> SessionStore::Create(const std::string& name, std::string bytes) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckName(name));
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::Session session, DescribeSession(name, bytes, name, limits_));
  const auto same = [&](const absl::StatusOr<v1::Session>& other) -> absl::StatusOr<v1::Session> {
    if (other.ok() && other->hash() == session.hash()) return session;
    return absl::AlreadyExistsError(
        absl::StrCat("session '", name, "' stands for other bytes",
                     other.ok() ? absl::StrCat(" (hash ", other->hash().substr(0, 8), ")") : "",
                     " and a session never changes: give ", session.hash().substr(0, 8),
                     " another name, or delete it first"));
  };
  const auto before = Find(name);
  if (before.ok() || !absl::IsNotFound(before.status())) return same(before);

  std::unique_lock<std::mutex> lock(mutex_, std::defer_lock);
  if (folder_.empty()) {
    lock.lock();
    // Two calls at once: the other one made the name.
    if (const auto found = known_.find(name); found != known_.end()) return same(found->second.session);
  }
  const Usage stored = Stored();
  if (stored.sessions >= kMaxSessions)
    return absl::ResourceExhaustedError(
        absl::StrCat("the store holds ", kMaxSessions, " sessions; delete some"));
  if (stored.bytes + bytes.size() > max_bytes_together_)
    return absl::ResourceExhaustedError(absl::StrCat("the store holds ", stored.bytes >> 20, " of ",
                                                     max_bytes_together_ >> 20,
                                                     " MiB (max_sessions_mib); delete some sessions"));
  if (folder_.empty()) {
    known_[name] = {session, {}, std::make_shared<const std::string>(std::move(bytes))};
    return session;
  }
  const absl::Status written = WriteNew(name, bytes);
  if (absl::IsAlreadyExists(written)) return same(Find(name));
  TOUCHSTONE_RETURN_IF_ERROR(written);
  Version version;
  if (Stat(name, &version)) {
    lock.lock();
    known_[name] = {session, version, nullptr};
  }
  return session;
}

absl::StatusOr<std::shared_ptr<const std::string>> SessionStore::Bytes(const std::string& name) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckName(name));
  if (folder_.empty()) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (const auto found = known_.find(name); found != known_.end()) return found->second.bytes;
    }
    return NoSession(name);
  }
  Version version;
  std::string path;
  if (!Stat(name, &version, &path)) return NoSession(name);
  TOUCHSTONE_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path));
  return std::make_shared<const std::string>(std::move(bytes));
}

absl::Status SessionStore::Export(
    const std::string& name, const std::function<bool(const std::string& file, absl::string_view)>& take) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckName(name));
  Version version;
  std::string path;
  if (!folder_.empty() && !Stat(name, &version, &path)) return NoSession(name);
  if (folder_.empty() || path == PathOf(name, true)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<const std::string> bytes, Bytes(name));
    return ForEachPiece(*bytes, kSessionPieceBytes, take);
  }
  // Open, the file stays as it is although its name may be deleted.
  std::ifstream file(path, std::ios::binary);
  std::string piece(kSessionPieceBytes, '\0');
  uint64_t taken = 0;
  while (taken < version.bytes && file.read(piece.data(), kSessionPieceBytes).gcount() > 0) {
    taken += file.gcount();
    if (!take("", absl::string_view(piece.data(), file.gcount()))) return absl::OkStatus();
  }
  if (taken != version.bytes)
    return absl::DataLossError(absl::StrCat(path, ": ended after ", taken, " of ", version.bytes, " bytes"));
  return absl::OkStatus();
}

absl::Status SessionStore::Delete(const std::string& name) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckName(name));
  bool known = false;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    known = known_.erase(name) > 0;
  }
  if (folder_.empty()) return known ? absl::OkStatus() : NoSession(name);
  Version version;
  std::string path;
  if (!Stat(name, &version, &path)) return NoSession(name);
  // The folder is the server's: what is wrong with it is no mistake of who asks.
  if (::unlink(path.c_str()) != 0)
    return absl::UnavailableError(FileError(errno, path, "cannot be removed").message());
  const absl::Status synced = SyncFolderOf(path);
  return synced.ok() ? synced : absl::UnavailableError(synced.message());
}

}  // namespace touchstone::service
