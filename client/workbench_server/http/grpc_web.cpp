#include "client/workbench_server/http/grpc_web.h"

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <cstdint>
#include <optional>

#include "server/base/text/printable.h"
#include "server/service/options/access_roles.h"

namespace touchstone::workbench {
namespace {

constexpr size_t kHeadBytes = 5;   // flags, and the length in network order
constexpr size_t kMaxShown = 100;  // of a path, in a message
constexpr uint8_t kCompressed = 0x01, kTrailers = 0x80;

std::string Frame(uint8_t flags, absl::string_view content) {
  const auto size = static_cast<uint32_t>(content.size());
  std::string frame;
  frame.reserve(kHeadBytes + content.size());
  frame += static_cast<char>(flags);
  for (int shift = 24; shift >= 0; shift -= 8) frame += static_cast<char>(size >> shift & 0xff);
  frame.append(content.data(), content.size());
  return frame;
}

}  // namespace

bool IsGrpcWebType(absl::string_view content_type) {
  const std::string type =
      absl::AsciiStrToLower(absl::StripAsciiWhitespace(content_type.substr(0, content_type.find(';'))));
  return type == "application/grpc-web" || type == kGrpcWebType;
}

absl::StatusOr<absl::string_view> OneMessage(absl::string_view body) {
  if (body.size() < kHeadBytes)
    return absl::InvalidArgumentError(absl::StrCat("gRPC-Web: the body has ", body.size(),
                                                   " bytes; a frame of 5 bytes and a message was expected"));
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(body[i]); };
  if (byte(0) == kCompressed)
    return absl::UnimplementedError(
        "gRPC-Web: the message is compressed; send it as it is (grpc-encoding: identity)");
  if (byte(0) != 0)
    return absl::InvalidArgumentError(
        absl::StrCat("gRPC-Web: the first frame has the flags ", byte(0), "; a message (0) was expected"));
  const uint64_t size = uint64_t{byte(1)} << 24 | byte(2) << 16 | byte(3) << 8 | byte(4);
  const uint64_t there = body.size() - kHeadBytes;
  if (size != there)
    return absl::InvalidArgumentError(absl::StrCat("gRPC-Web: the frame says ", size, " bytes and ", there,
                                                   " follow; exactly one message was expected"));
  return body.substr(kHeadBytes);
}

std::string MessageFrame(absl::string_view message) {
  return Frame(0, message);
}

std::string HeaderValue(const std::string& name, absl::string_view value) {
  if (!absl::EndsWith(name, "-bin")) return std::string(value);
  return std::string(absl::StripSuffix(absl::StripSuffix(absl::Base64Escape(value), "="), "="));
}

std::string TrailersFrame(const grpc::Status& status, const Metadata& metadata) {
  std::string text = absl::StrCat("grpc-status: ", static_cast<int>(status.error_code()), "\r\n");
  if (!status.error_message().empty())
    absl::StrAppend(&text, "grpc-message: ", PercentEncoded(status.error_message()), "\r\n");
  for (const auto& [key, value] : metadata) {
    const std::string name(key.data(), key.size());
    absl::StrAppend(&text, name, ": ", HeaderValue(name, {value.data(), value.size()}), "\r\n");
  }
  return Frame(kTrailers, text);
}

std::string PercentEncoded(absl::string_view text) {
  std::string encoded;
  for (const char c : text) {
    if (c >= ' ' && c <= '~' && c != '%')
      encoded += c;
    else
      absl::StrAppend(&encoded, "%", absl::AsciiStrToUpper(absl::BytesToHexString({&c, 1})));
  }
  return encoded;
}

std::optional<std::chrono::nanoseconds> ParseTimeout(absl::string_view text) {
  constexpr size_t kMaxDigits = 8;
  uint64_t count = 0;
  if (text.size() < 2 || text.size() > kMaxDigits + 1 || !absl::ascii_isdigit(text[0]) ||
      !absl::SimpleAtoi(text.substr(0, text.size() - 1), &count))
    return std::nullopt;
  switch (text.back()) {
    case 'H':
      return std::chrono::hours(std::min<uint64_t>(count, 100'000));
    case 'M':
      return std::chrono::minutes(std::min<uint64_t>(count, 6'000'000));
    case 'S':
      return std::chrono::seconds(count);
    case 'm':
      return std::chrono::milliseconds(count);
    case 'u':
      return std::chrono::microseconds(count);
    case 'n':
      return std::chrono::nanoseconds(count);
    default:
      return std::nullopt;
  }
}

absl::Status CheckMethod(absl::string_view path) {
  const std::optional<service::Role> role = service::RoleNeeded(path, service::Motion::kRig);
  if (!role.has_value())
    return absl::UnimplementedError(absl::StrCat(Printable(path, kMaxShown), " is no method of Touchstone"));
  if (*role <= service::Role::kReader) return absl::OkStatus();
  return absl::PermissionDeniedError(absl::StrCat(path, " needs the role ", service::RoleName(*role),
                                                  ", and the page calls as a reader: what moves a rig goes "
                                                  "through its view Touch (--rig), and what changes what a "
                                                  "server keeps through the command line"));
}

}  // namespace touchstone::workbench
