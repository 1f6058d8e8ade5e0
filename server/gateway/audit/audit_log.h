// What was done with the rig and by whom: one JSON object a line, appended and on the disk before anything
// follows. Software cannot make it tamper-proof; it never rewrites a line.
#pragma once

#include <functional>
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
  // From now on every line that does not itself name a holder gets "lease_holder": who holds the lease when it is
  // written; none while nobody does. `lease_holder` is called in any thread, and must outlive the log's last line.
  virtual void NameHolders(std::function<std::string()> lease_holder) = 0;
  // {"time": "2026-01-31T12:00:00.123Z", "event": "stop", "who": ..., "lease_holder": ...}. Thread-safe;
  // fdatasync before it returns.
  virtual absl::Status Write(const std::string& event,
                             const std::vector<std::pair<std::string, std::string>>& fields) = 0;
};

}  // namespace touchstone::gateway::audit
