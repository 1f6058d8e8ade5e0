// Where a socket listens, as configurations and flags write it.
#pragma once

#include <optional>
#include <string>

#include <absl/strings/string_view.h>

namespace touchstone::service {

struct HostPort {
  std::string host;  // without the brackets of an IPv6 address; may be empty
  int port = 0;      // 0 to 65535
};

// Of "HOST:PORT", "[::1]:PORT" or ":PORT"; nothing where the port is no such number in digits. (The system's own reading
// takes 65536 for 0.)
std::optional<HostPort> ParseHostPort(absl::string_view address);

}  // namespace touchstone::service
