#include "server/service/core/access_file.h"

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <openssl/crypto.h>
#include <openssl/rand.h>

#include <algorithm>

#include "server/base/check.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::service {
namespace {

constexpr char kHashPrefix[] = "sha256:";
constexpr char kCertificatePrefix[] = "cert:";
constexpr size_t kHexDigits = 64;

bool IsHash(absl::string_view text) {
  return text.size() == kHexDigits &&
         std::all_of(text.begin(), text.end(), [](char c) { return absl::ascii_isxdigit(c); });
}

}  // namespace

std::string NewAccessToken() {
  unsigned char bytes[32];
  TOUCHSTONE_CHECK(RAND_bytes(bytes, sizeof bytes) == 1);
  std::string text = absl::WebSafeBase64Escape(
      absl::string_view(reinterpret_cast<const char*>(bytes), sizeof bytes));  // without '='
  OPENSSL_cleanse(bytes, sizeof bytes);
  return "ts_" + text;
}

std::string HashOfToken(absl::string_view token) {
  return kHashPrefix + Sha256Hex(std::string(token));
}

absl::Status CheckCallerName(absl::string_view name) {
  constexpr size_t kMaxBytes = 64;
  const bool plain =
      !name.empty() && name.size() <= kMaxBytes && std::all_of(name.begin(), name.end(), [](char c) {
        return absl::ascii_isalnum(c) || absl::string_view("_.-@").find(c) != absl::string_view::npos;
      });
  if (plain) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("name: must be 1 to ", kMaxBytes, " letters, digits, '_', '.', '-' or '@'"));
}

absl::StatusOr<AccessFile> AccessFile::Parse(absl::string_view text, const std::string& origin) {
  AccessFile file;
  int number = 0;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    ++number;
    const absl::string_view stripped = absl::StripAsciiWhitespace(line);
    if (stripped.empty() || stripped[0] == '#') continue;
    const auto wrong = [&](absl::string_view what) {
      return absl::InvalidArgumentError(absl::StrCat(origin, ":", number, ": ", what));
    };
    const std::vector<absl::string_view> words =
        absl::StrSplit(stripped, absl::ByAnyChar(" \t"), absl::SkipEmpty());
    if (words.size() != 3)
      return wrong(absl::StrCat("has ", words.size(),
                                " words; a line is NAME ROLE sha256:HASH, as touchstone token "
                                "new writes it, or NAME ROLE cert:NAME-IN-THE-CERTIFICATE"));
    if (const absl::Status name = CheckCallerName(words[0]); !name.ok()) return wrong(name.message());
    const absl::StatusOr<Role> role = ParseRole(words[1]);
    if (!role.ok()) return wrong("the role must be reader, operator or admin");
    const Caller caller = {std::string(words[0]), *role};
    absl::string_view credential = words[2];
    if (absl::StartsWith(credential, kCertificatePrefix) &&
        credential.size() > sizeof kCertificatePrefix - 1) {
      credential.remove_prefix(sizeof kCertificatePrefix - 1);
      file.certificates_.push_back({std::string(credential), caller});
    } else if (absl::StartsWith(credential, kHashPrefix) &&
               IsHash(credential.substr(sizeof kHashPrefix - 1))) {
      file.tokens_.push_back({absl::AsciiStrToLower(credential), caller});
    } else {
      return wrong(
          "the third word must be sha256: and 64 hexadecimal digits, or cert: and a name; the token itself "
          "does not belong "
          "here");
    }
  }
  return file;
}

std::optional<Caller> AccessFile::FindToken(absl::string_view token) const {
  const std::string hash = HashOfToken(token);
  const Entry* found = nullptr;
  for (const Entry& entry : tokens_)
    if (CRYPTO_memcmp(entry.credential.data(), hash.data(), hash.size()) == 0) found = &entry;
  if (found == nullptr) return std::nullopt;
  return found->caller;
}

std::optional<Caller> AccessFile::FindCertificate(const std::vector<std::string>& names) const {
  for (const Entry& entry : certificates_)
    if (std::find(names.begin(), names.end(), entry.credential) != names.end()) return entry.caller;
  return std::nullopt;
}

}  // namespace touchstone::service
