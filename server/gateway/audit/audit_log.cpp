#include "server/gateway/audit/audit_log.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <mutex>
#include <nlohmann/json.hpp>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/printable.h"

namespace touchstone::gateway::audit {
namespace {

absl::Status AuditError(const std::string& path, const std::string& what, const std::string& remedy) {
  const int error = errno;
  const std::string message =
      absl::StrCat("audit log ", path, ": ", what, " (", std::strerror(error), "); ", remedy);
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) return absl::ResourceExhaustedError(message);
  if (error == EACCES || error == EPERM || error == EROFS) return absl::PermissionDeniedError(message);
  return absl::UnavailableError(message);
}

// "2026-01-31T12:00:00.123Z".
std::string UtcNow() {
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  const int64_t milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(since_epoch).count();
  const time_t seconds = static_cast<time_t>(milliseconds / 1000);
  struct tm utc {};
  gmtime_r(&seconds, &utc);
  char day[32], fraction[8];
  std::strftime(day, sizeof day, "%Y-%m-%dT%H:%M:%S", &utc);
  std::snprintf(fraction, sizeof fraction, ".%03dZ", static_cast<int>(milliseconds % 1000));
  return absl::StrCat(day, fraction);
}

std::string Line(const std::string& event, const std::vector<std::pair<std::string, std::string>>& fields,
                 const std::string& lease_holder) {
  nlohmann::ordered_json line;
  line["time"] = UtcNow();
  line["event"] = event;
  for (const auto& [name, value] : fields) line[name] = value;
  if (!lease_holder.empty() && !line.contains("holder")) line["lease_holder"] = lease_holder;
  // Bytes that are no UTF-8 must not lose the line.
  return EscapeInJson(line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) + "\n";
}

class NoAuditLog : public AuditLog {
 public:
  void NameHolders(std::function<std::string()>) override {}
  absl::Status Write(const std::string&, const std::vector<std::pair<std::string, std::string>>&) override {
    return absl::OkStatus();
  }
};

class FileAuditLog : public AuditLog {
 public:
  FileAuditLog(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}
  ~FileAuditLog() override { close(descriptor_); }

  void NameHolders(std::function<std::string()> lease_holder) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    lease_holder_ = std::move(lease_holder);
  }

  absl::Status Write(const std::string& event,
                     const std::vector<std::pair<std::string, std::string>>& fields) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    // The time is taken under the lock, so that the lines stand in its order.
    std::string line = Line(event, fields, lease_holder_ ? lease_holder_() : "");
    if (cut_line_) line.insert(line.begin(), '\n');
    size_t written = 0;
    if (const absl::Status failed = WriteAll(descriptor_, path_, line, &written); !failed.ok()) {
      cut_line_ = cut_line_ || written > 0;
      return absl::Status(absl::IsResourceExhausted(failed) ? failed.code() : absl::StatusCode::kUnavailable,
                          absl::StrCat("audit log ", failed.message(), "; make room on its disk"));
    }
    cut_line_ = false;
    const absl::Status synced = SyncDescriptor(descriptor_, path_);
    if (synced.ok()) return synced;
    return absl::UnavailableError(absl::StrCat("audit log ", synced.message(), "; check its disk"));
  }

  // A power cut or a full disk may have left a line without its end: the next one must not be glued to it.
  absl::Status CheckLastLine() {
    struct stat facts {};
    if (fstat(descriptor_, &facts) != 0) return AuditError(path_, "cannot be examined", "check its disk");
    if (!S_ISREG(facts.st_mode))
      return absl::InvalidArgumentError(
          absl::StrCat("audit log ", path_, ": is no regular file; name a file to append to"));
    if (facts.st_size == 0) return absl::OkStatus();
    char last = 0;
    if (pread(descriptor_, &last, 1, facts.st_size - 1) != 1)
      return AuditError(path_, "cannot be read", "check its disk");
    cut_line_ = last != '\n';
    return absl::OkStatus();
  }

 private:
  const std::string path_;
  const int descriptor_;
  std::function<std::string()> lease_holder_;
  std::mutex mutex_;
  bool cut_line_ = false;
};

}  // namespace

absl::StatusOr<std::unique_ptr<AuditLog>> AuditLog::Open(const std::string& path) {
  if (path.empty()) return std::unique_ptr<AuditLog>(new NoAuditLog);
  const int descriptor = OpenFile(path, O_RDWR | O_APPEND | O_CREAT, 0640);
  if (descriptor < 0)
    return AuditError(path, "cannot be opened", "name a file in a folder that exists and may be written");
  auto log = std::make_unique<FileAuditLog>(path, descriptor);
  TOUCHSTONE_RETURN_IF_ERROR(log->CheckLastLine());
  if (const absl::Status synced = SyncFolderOf(path); !synced.ok())
    return absl::UnavailableError(
        absl::StrCat("audit log ", path, ": ", synced.message(), "; check its disk"));
  return log;
}

}  // namespace touchstone::gateway::audit
