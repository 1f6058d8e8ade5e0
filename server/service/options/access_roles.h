// Which role every method needs. A method that is not in the table is served by nobody: a server with one does not start.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::service {

// Each role may do what those before it may.
enum class Role {
  kNobody,    // asks for no credentials: health checking and reflection
  kReader,    // reads, simulates, streams; may stop a source
  kOperator,  // moves a rig
  kAdmin,     // changes what is stored
};

const char* RoleName(Role role);  // "reader"
// "reader", "operator" or "admin".
absl::StatusOr<Role> ParseRole(absl::string_view name);

// Whether calls move a rig, or only this process's numbers.
enum class Motion { kSimulated, kRig };

struct MethodRole {
  const char* method;  // "/touchstone.v1.Source/Touch", as in :path
  Role simulated;
  Role rig;
};

// Of every method of every service of servers and gateways.
const std::vector<MethodRole>& MethodRoles();

// That of a method by its path; none if the table has no such method.
std::optional<Role> RoleNeeded(absl::string_view method, Motion motion);

// That every method of a service ("touchstone.v1.Source") has a role; INTERNAL names those that have none.
absl::Status CheckRolesOf(const std::string& service);

// "Source.Touch" of "/touchstone.v1.Source/Touch".
std::string MethodName(absl::string_view method);

}  // namespace touchstone::service
