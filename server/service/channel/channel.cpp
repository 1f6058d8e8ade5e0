#include "server/service/channel/channel.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <grpcpp/create_channel.h>
#include <unistd.h>

#include <cstdlib>

#include "server/service/channel/host_port.h"

namespace touchstone::service {
namespace {

struct Variable {
  const char* name = nullptr;
  std::string value;
};

// The first that is set, also to nothing.
Variable FirstSet(std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (const char* const value = std::getenv(name); value != nullptr) return {name, value};
  return {};
}

// "dns:///bench2:50051" is bench2.
std::string HostOf(absl::string_view address) {
  for (const char* scheme : {"dns:", "ipv4:", "ipv6:"})
    if (absl::ConsumePrefix(&address, scheme)) break;
  address.remove_prefix(address.rfind('/') + 1);  // npos + 1 is 0
  const std::optional<HostPort> parsed = ParseHostPort(address);
  return parsed ? parsed->host : std::string(address);
}

bool IsOwnName(const std::string& host) {
  char own[256] = "";
  return ::gethostname(own, sizeof own - 1) == 0 && absl::EqualsIgnoreCase(host, own);
}

}  // namespace

std::string ProxyFor(const std::string& address) {
  const Variable proxy = FirstSet({"grpc_proxy", "https_proxy", "http_proxy"});
  absl::string_view url = proxy.value;
  if (IsLocalAddress(address) || !absl::ConsumePrefix(&url, "http://")) return "";
  const std::string host = HostOf(address);
  if (IsOwnName(host)) return "";
  const Variable direct = FirstSet({"no_grpc_proxy", "no_proxy"});
  for (absl::string_view end : absl::StrSplit(direct.value, ',')) {
    end = absl::StripAsciiWhitespace(end);
    if (!end.empty() && absl::EndsWithIgnoreCase(host, end)) return "";
  }
  url = url.substr(url.rfind('@') == absl::string_view::npos ? 0 : url.rfind('@') + 1);
  return absl::StrCat("the proxy http://", url.substr(0, url.find_first_of("/?#")), " (", proxy.name, ")");
}

std::shared_ptr<grpc::Channel> OpenChannel(const std::string& address,
                                           const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                                           grpc::ChannelArguments arguments, Interceptors interceptors,
                                           ProxyUse proxy) {
  // gRPC has the same rules, but for this machine: without this, calls to 127.0.0.1 go to the proxy.
  if (proxy == ProxyUse::kNever || ProxyFor(address).empty()) arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  return grpc::experimental::CreateCustomChannelWithInterceptors(address, credentials, arguments,
                                                                 std::move(interceptors));
}

}  // namespace touchstone::service
