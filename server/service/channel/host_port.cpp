#include "server/service/channel/host_port.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <arpa/inet.h>

#include <algorithm>

namespace touchstone::service {
namespace {

// Only whole addresses: 127.evil.example is a name like any other.
bool IsLoopback(const std::string& host) {
  in_addr four{};
  if (::inet_pton(AF_INET, host.c_str(), &four) == 1) return ntohl(four.s_addr) >> 24 == 127;
  in6_addr six{};
  if (::inet_pton(AF_INET6, host.c_str(), &six) != 1) return absl::EqualsIgnoreCase(host, "localhost");
  return IN6_IS_ADDR_LOOPBACK(&six) || (IN6_IS_ADDR_V4MAPPED(&six) && six.s6_addr[12] == 127);
}

}  // namespace

std::optional<HostPort> ParseHostPort(absl::string_view address) {
  const size_t colon = address.rfind(':');
  if (colon == absl::string_view::npos) return std::nullopt;
  const absl::string_view digits = address.substr(colon + 1);
  HostPort parsed;
  if (digits.empty() || digits.size() > 5 ||
      !std::all_of(digits.begin(), digits.end(), absl::ascii_isdigit) ||
      !absl::SimpleAtoi(digits, &parsed.port) || parsed.port > 65535)
    return std::nullopt;
  absl::string_view host = address.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  parsed.host = std::string(host);
  return parsed;
}

bool IsLocalAddress(absl::string_view address) {
  if (address.empty() || absl::StartsWith(address, "unix:") || absl::StartsWith(address, "unix-abstract:"))
    return true;
  // "dns://server/name:port" asks that server what the name means, and stays a foreign one.
  for (const char* scheme : {"dns:///", "dns:", "ipv4:", "ipv6:"})
    if (absl::ConsumePrefix(&address, scheme)) break;
  for (const absl::string_view each : absl::StrSplit(address, ',')) {
    const std::optional<HostPort> parsed = ParseHostPort(each);
    if (!parsed || !IsLoopback(parsed->host)) return false;
  }
  return true;
}

}  // namespace touchstone::service
