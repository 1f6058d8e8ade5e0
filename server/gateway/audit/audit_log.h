// What was done with the rig and by whom: one JSON object a line, appended and on the disk before anything
// follows. Software cannot make it tamper-proof; it never rewrites a line.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>

namespace touchstone::gateway::audit {

class AuditLog {
 public:
  // Empty path: keeps nothing.
  static absl::StatusOr<std::unique_ptr<AuditLog>> Open(const std::string& path);
  virtual ~AuditLog() = default;
  // {"time": "2026-01-31T12:00:00.123Z", "event": "stop", "holder": ..., ...}. Thread-safe; fdatasync
  // before it returns.
  virtual absl::Status Write(const std::string& event,
                             const std::vector<std::pair<std::string, std::string>>& fields) = 0;
};

}  // namespace touchstone::gateway::audit
