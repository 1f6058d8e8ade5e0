#include "client/workbench_server/http/request_guard.h"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <openssl/crypto.h>
#include <openssl/rand.h>

#include "server/base/check.h"
#include "server/base/status.h"
#include "server/base/text/printable.h"

namespace touchstone::workbench {
namespace {

constexpr size_t kTokenBytes = 16;
constexpr size_t kMaxShown = 100;  // of a header, in a message

std::string Text(boost::beast::string_view value) {
  return std::string(value.data(), value.size());
}

std::string Shown(const std::string& text) {
  return Printable(text, kMaxShown);
}

// "[::1]" of "[::1]:8000", "localhost" of "localhost".
std::string WithoutPort(const std::string& host) {
  const size_t colon = host.rfind(':');
  const bool has_port = colon != std::string::npos && host.find(']', colon) == std::string::npos;
  return has_port ? host.substr(0, colon) : host;
}

// A name of this machine that no DNS server can point elsewhere; any port, since it may be forwarded (ssh -L).
absl::Status CheckHost(const std::string& host) {
  const std::string name = WithoutPort(host);
  if (name == "127.0.0.1" || name == "localhost" || name == "[::1]") return absl::OkStatus();
  return absl::PermissionDeniedError(
      absl::StrCat("the host '", Shown(host),
                   "' is not this machine; 127.0.0.1 or localhost was expected, as in the "
                   "address that touchstone workbench printed"));
}

absl::Status OtherPage(const std::string& who, const std::string& host) {
  return absl::PermissionDeniedError(absl::StrCat(who, "; only the page at http://", host, " may"));
}

}  // namespace

std::string NewToken() {
  unsigned char bytes[kTokenBytes];
  TOUCHSTONE_CHECK(RAND_bytes(bytes, sizeof bytes) == 1);
  return absl::BytesToHexString({reinterpret_cast<const char*>(bytes), sizeof bytes});
}

absl::Status CheckOrigin(const boost::beast::http::fields& head, bool page) {
  using boost::beast::http::field;
  const std::string host = Text(head[field::host]);
  TOUCHSTONE_RETURN_IF_ERROR(CheckHost(host));
  const auto origin = head.find(field::origin);
  if (origin != head.end() && Text(origin->value()) != "http://" + host)
    return OtherPage(absl::StrCat("a page of '", Shown(Text(origin->value())), "' asks"), host);
  const std::string site = Text(head["Sec-Fetch-Site"]);
  const bool opened =
      page && Text(head["Sec-Fetch-Mode"]) == "navigate" && Text(head["Sec-Fetch-Dest"]) == "document";
  if (!site.empty() && site != "same-origin" && site != "none" && !opened)
    return OtherPage(absl::StrCat("another page asks (Sec-Fetch-Site: ", Shown(site), ")"), host);
  return absl::OkStatus();
}

absl::Status CheckOriginBesidePage(const boost::beast::http::fields& head) {
  using boost::beast::http::field;
  const std::string host = Text(head[field::host]), origin = Text(head[field::origin]);
  TOUCHSTONE_RETURN_IF_ERROR(CheckHost(host));
  const std::string name = "http://" + WithoutPort(host);
  if (!origin.empty() && origin.rfind(name + ":", 0) != 0)
    return OtherPage(absl::StrCat("a page of '", Shown(origin), "' asks"), WithoutPort(host));
  const std::string site = Text(head["Sec-Fetch-Site"]);
  if (!site.empty() && site != "same-origin" && site != "same-site")
    return OtherPage(absl::StrCat("another page asks (Sec-Fetch-Site: ", Shown(site), ")"),
                     WithoutPort(host));
  return absl::OkStatus();
}

absl::Status CheckToken(const boost::beast::http::fields& head, const std::string& token) {
  return CheckToken(Text(head[kTokenHeader]), token);
}

absl::Status CheckToken(const std::string& shown, const std::string& token) {
  if (shown.size() == token.size() && CRYPTO_memcmp(shown.data(), token.data(), token.size()) == 0)
    return absl::OkStatus();
  return absl::UnauthenticatedError(
      "the token is missing or another one; open the whole address that touchstone workbench printed, with "
      "what follows #");
}

}  // namespace touchstone::workbench
