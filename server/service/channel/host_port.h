// Where a socket listens or a client connects, as configurations and flags write it.
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

// Whether only this machine reaches an address: 127.0.0.0/8, [::1], localhost, unix:PATH, or no address at all; also behind
// gRPC's own "dns:", "ipv4:" and "ipv6:", where every address of a list must be such a one.
bool IsLocalAddress(absl::string_view address);

}  // namespace touchstone::service
