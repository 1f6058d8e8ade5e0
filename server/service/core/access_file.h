// The file of those who may call: a line each, "NAME ROLE CREDENTIAL". A token stands in it as its SHA-256 only, which is
// enough for what has 256 random bits; a client certificate stands there by one of its names.
//   # comment
//   training  reader    sha256:9f86d0...
//   node7     operator  cert:node7.lab
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/service/options/access_roles.h"

namespace touchstone::service {

// Who calls. Empty name: nobody was asked.
struct Caller {
  std::string name;
  Role role = Role::kAdmin;
};

// "ts_" and 43 letters of base64url: 256 random bits.
std::string NewAccessToken();
// "sha256:..." of a token, as it stands in the file.
std::string HashOfToken(absl::string_view token);
// 1 to 64 letters, digits, '_', '.', '-' or '@'.
absl::Status CheckCallerName(absl::string_view name);

class AccessFile {
 public:
  // Errors name `origin` and the line, never what stands in the credential's place: it may be a token.
  static absl::StatusOr<AccessFile> Parse(absl::string_view text, const std::string& origin);

  // In a time that depends on how many there are, not on how much of a hash is right.
  std::optional<Caller> FindToken(absl::string_view token) const;
  std::optional<Caller> FindCertificate(const std::vector<std::string>& names) const;
  int tokens() const { return static_cast<int>(tokens_.size()); }
  int certificates() const { return static_cast<int>(certificates_.size()); }

 private:
  struct Entry {
    std::string credential;  // "sha256:..." or the name of a certificate
    Caller caller;
  };
  std::vector<Entry> tokens_, certificates_;
};

}  // namespace touchstone::service
