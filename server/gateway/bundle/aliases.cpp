#include "server/gateway/bundle/aliases.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

namespace touchstone::gateway::bundle {
namespace {

// Runs of letters and digits from this length on are taken for keys, those of tokens among them.
constexpr size_t kSecretBytes = 24;
constexpr char kLeftOut[] = "[left out]";

const char* NameOf(AliasKind kind) {
  switch (kind) {
    case AliasKind::kPerson:
      return "person";
    case AliasKind::kHost:
      return "host";
    case AliasKind::kPath:
      return "path";
    case AliasKind::kSecret:
      return "secret";
    case AliasKind::kSession:
      return "session";
    case AliasKind::kHidden:
      return "hidden";
  }
  return "hidden";
}

bool IsLoopback(absl::string_view host) {
  return host.empty() || host == "localhost" || host == "0.0.0.0" || host == "::1" || host == "::" ||
         absl::StartsWith(host, "127.");
}

// What ends a word.
bool IsBreak(char c) {
  return absl::StrContains(" \t\r\n'\"`()[]{}<>,;|", c);
}

bool HasBreak(const std::string& name) {
  return std::any_of(name.begin(), name.end(), IsBreak);
}

bool IsIpv4(absl::string_view text) {
  const std::vector<absl::string_view> parts = absl::StrSplit(text, '.');
  return parts.size() == 4 && std::all_of(parts.begin(), parts.end(), [](absl::string_view part) {
           return !part.empty() && part.size() <= 3 &&
                  std::all_of(part.begin(), part.end(), absl::ascii_isdigit);
         });
}

// IPv6, or the hardware address of a network card; a time (12:00:01) is neither.
bool IsColonAddress(absl::string_view text) {
  const size_t colons = std::count(text.begin(), text.end(), ':');
  const bool hex = std::all_of(text.begin(), text.end(),
                               [](char c) { return absl::ascii_isxdigit(c) || c == ':' || c == '.'; });
  return hex && (colons >= 5 || (colons >= 2 && absl::StrContains(text, "::")));
}

// A name with a domain. What ends otherwise may be a file, a version or a field's name.
bool IsDomainName(absl::string_view text) {
  const std::vector<absl::string_view> parts = absl::StrSplit(text, '.');
  if (parts.size() < 2) return false;
  for (const absl::string_view part : parts) {
    if (part.empty()) return false;
    for (const char c : part)
      if (!absl::ascii_isalnum(c) && c != '-') return false;
  }
  for (const char* last :
       {"local", "lan", "lab", "home", "internal", "intranet", "localdomain", "corp", "edu",
        "com",   "org", "net", "gov",  "io",       "de",       "ch",          "at",   "fr",
        "uk",    "eu",  "nl",  "it",   "es",       "se",       "dk",          "no",   "pl",
        "cz",    "jp",  "cn",  "kr",   "in",       "us",       "ca",          "au"})
    if (absl::EqualsIgnoreCase(parts.back(), last)) return true;
  return false;
}

bool IsPath(absl::string_view text) {
  if (absl::StartsWith(text, "~/")) return true;
  if (text.size() > 2 && absl::ascii_isalpha(text[0]) && text[1] == ':' &&
      (text[2] == '\\' || text[2] == '/'))
    return true;
  return text.size() > 1 && text[0] == '/' && text[1] != '/' && text != "/s";
}

bool IsDevicePort(absl::string_view text) {
  return absl::StartsWith(text, "/dev/tty") || absl::StartsWith(text, "/dev/video") ||
         absl::StartsWith(text, "/dev/pts/");
}

// A key, or a token of this program (ts_...): long, and no word. What a hash looks like looks like a key, too.
bool IsSecret(absl::string_view text) {
  if (absl::StartsWith(text, "ts_")) return true;
  if (text.size() < kSecretBytes) return false;
  bool digit = false, letter = false;
  for (const char c : text) {
    if (!absl::ascii_isalnum(c) && c != '_' && c != '-' && c != '+' && c != '=') return false;
    digit = digit || absl::ascii_isdigit(c), letter = letter || absl::ascii_isalpha(c);
  }
  return digit && letter;
}

// ".yaml" of a path, which says what kind of file it is; empty: none.
absl::string_view ExtensionOf(absl::string_view path) {
  const size_t dot = path.find_last_of("./\\");
  if (dot == absl::string_view::npos || path[dot] != '.' || dot == 0) return "";
  const absl::string_view extension = path.substr(dot);
  const bool plain = std::all_of(extension.begin() + 1, extension.end(), absl::ascii_isalnum);
  return extension.size() > 1 && extension.size() <= 6 && plain ? extension : "";
}

// The end of what begins with a path's word: parts of names with blanks in them belong to it as long as slashes follow.
size_t EndOfPath(absl::string_view text, size_t end) {
  while (end < text.size() && text[end] == ' ') {
    size_t next = end + 1;
    while (next < text.size() && !IsBreak(text[next])) ++next;
    const absl::string_view word = text.substr(end + 1, next - end - 1);
    if (!absl::StrContains(word, '/') || word[0] == '/') break;
    end = next;
  }
  return end;
}

// Behind a holder: up to two words (program and process), then "(WHY)". The place of the bracket, or npos.
size_t BracketBehind(absl::string_view text, size_t from) {
  for (int words = 0; words <= 2; ++words) {
    if (from + 1 >= text.size() || text[from] != ' ') return absl::string_view::npos;
    if (text[from + 1] == '(') return from + 1;
    ++from;
    while (from < text.size() && !IsBreak(text[from])) ++from;
  }
  return absl::string_view::npos;
}

size_t ClosingBracket(absl::string_view text, size_t open) {
  int depth = 0;
  for (size_t k = open; k < text.size(); ++k) {
    depth += text[k] == '(' ? 1 : text[k] == ')' ? -1 : 0;
    if (depth == 0) return k;
  }
  return text.size();
}

}  // namespace

std::string Aliases::Of(AliasKind kind, absl::string_view name) {
  std::string& alias = aliases_[{kind, absl::AsciiStrToLower(name)}];
  if (alias.empty())
    alias =
        absl::StrCat(NameOf(kind), "-", ++count_[kind], kind == AliasKind::kPath ? ExtensionOf(name) : "");
  return alias;
}

void Aliases::Learn(AliasKind kind, absl::string_view name) {
  name = absl::StripAsciiWhitespace(name);
  if (name.size() < 2 || IsLoopback(name)) return;
  const std::string small = absl::AsciiStrToLower(name);
  for (const auto& [known, alias] : learned_)
    if (known == small) return;
  learned_.emplace_back(small, Of(kind, name));
  std::stable_sort(learned_.begin(), learned_.end(),
                   [](const auto& a, const auto& b) { return a.first.size() > b.first.size(); });
}

void Aliases::LearnThisMachine() {
  char host[256] = "";
  if (gethostname(host, sizeof host - 1) == 0) {
    Learn(AliasKind::kHost, host);
    Learn(AliasKind::kHost, std::string(host).substr(0, std::string(host).find('.')));
  }
  // The superuser and the folders of every system are nobody's.
  const passwd* const user = getpwuid(getuid());
  if (user != nullptr && user->pw_uid != 0) {
    Learn(AliasKind::kPerson, user->pw_name);
    const std::string full = std::string(user->pw_gecos).substr(0, std::string(user->pw_gecos).find(','));
    for (const absl::string_view part : absl::StrSplit(full, ' '))
      if (part.size() > 2) Learn(AliasKind::kPerson, part);
    if (std::string(user->pw_dir).size() > 1) Learn(AliasKind::kPath, user->pw_dir);
  }
  for (const char* variable : {"SUDO_USER", "LOGNAME", "USER"})
    if (const char* name = std::getenv(variable); name != nullptr && std::string(name) != "root")
      Learn(AliasKind::kPerson, name);
  if (const char* home = std::getenv("HOME");
      home != nullptr && std::string(home) != "/root" && std::string(home) != "/")
    Learn(AliasKind::kPath, home);
}

void Aliases::LearnHolder(absl::string_view holder) {
  const absl::string_view word = holder.substr(0, holder.find(' '));
  const size_t at = word.rfind('@');
  if (at != absl::string_view::npos) {
    Learn(AliasKind::kPerson, word.substr(0, at));
    Learn(AliasKind::kHost, word.substr(at + 1));
  }
  // "(NAME, ROLE)": whom the gateway's credentials showed.
  const size_t open = holder.find('('), comma = holder.find(", ", open == absl::string_view::npos ? 0 : open);
  if (open != absl::string_view::npos && comma != absl::string_view::npos)
    Learn(AliasKind::kPerson, holder.substr(open + 1, comma - open - 1));
}

std::string Aliases::Note(absl::string_view text) {
  if (text.empty()) return "";
  ++notes_;
  return kLeftOut;
}

std::string Aliases::Known(absl::string_view word, bool of_words) {
  const std::string small = absl::AsciiStrToLower(word);
  std::string result;
  for (size_t k = 0; k < word.size();) {
    const bool begins = k == 0 || !absl::ascii_isalnum(word[k - 1]);
    const std::pair<std::string, std::string>* found = nullptr;
    for (const auto& learned : learned_) {
      const size_t end = k + learned.first.size();
      if (begins && HasBreak(learned.first) == of_words &&
          small.compare(k, learned.first.size(), learned.first) == 0 &&
          (end >= word.size() || !absl::ascii_isalnum(word[end]))) {
        found = &learned;
        break;
      }
    }
    if (found == nullptr) {
      result += word[k++];
      continue;
    }
    result += found->second;
    k += found->first.size();
  }
  return result;
}

std::string Aliases::Host(absl::string_view text) {
  absl::string_view host = text, port;
  const size_t colon = text.rfind(':');
  if (colon != absl::string_view::npos && !IsColonAddress(text))
    host = text.substr(0, colon), port = text.substr(colon);
  host = absl::StripSuffix(absl::StripPrefix(host, "["), "]");
  if (IsLoopback(host)) return std::string(text);
  for (const auto& [known, alias] : learned_)
    if (known == absl::AsciiStrToLower(host)) return absl::StrCat(alias, port);
  return absl::StrCat(Of(AliasKind::kHost, host), port);
}

std::string Aliases::Url(absl::string_view url) {
  const size_t begin = url.find("://") + 3;
  const std::string scheme(url.substr(0, begin));
  absl::string_view rest = url.substr(begin);
  if (scheme == "file://") return absl::StrCat(scheme, Of(AliasKind::kPath, rest));
  const size_t slash = std::min(rest.find_first_of("/?#"), rest.size());
  absl::string_view authority = rest.substr(0, slash);
  rest = rest.substr(slash);
  if (const size_t at = authority.rfind('@'); at != absl::string_view::npos) {
    ++notes_;  // name and password
    authority = authority.substr(at + 1);
  }
  return absl::StrCat(scheme, Host(authority),
                      rest.size() > 1 ? "/" + Of(AliasKind::kPath, rest) : std::string(rest));
}

std::string Aliases::Word(absl::string_view word) {
  // What ends a sentence is no part of a name.
  size_t end = word.size();
  while (end > 0 && absl::StrContains(".:!?", word[end - 1])) --end;
  const absl::string_view tail = word.substr(end);
  word = word.substr(0, end);
  if (word.empty()) return std::string(tail);
  for (const char* scheme : {"ipv4:", "ipv6:"})  // as gRPC names a peer
    if (absl::StartsWith(word, scheme))
      return absl::StrCat(scheme, Host(word.substr(std::string(scheme).size())), tail);
  if (absl::StrContains(word, "://")) return Url(word) + std::string(tail);
  if (const size_t equals = word.find('='); equals != absl::string_view::npos && !IsSecret(word))
    return absl::StrCat(Known(word.substr(0, equals)), "=", Word(word.substr(equals + 1)), tail);
  if (IsPath(word))
    return absl::StrCat(IsDevicePort(word) ? std::string(word) : Of(AliasKind::kPath, word), tail);
  if (const size_t at = word.rfind('@'); at != absl::string_view::npos && at > 0 && at + 1 < word.size()) {
    LearnHolder(word);
    return absl::StrCat(Of(AliasKind::kPerson, word.substr(0, at)), "@", Host(word.substr(at + 1)), tail);
  }
  const absl::string_view before_port = word.substr(0, word.rfind(':'));
  if (IsIpv4(before_port) || IsColonAddress(word) || IsDomainName(before_port) || word[0] == '[')
    return absl::StrCat(Host(word), tail);
  // A touch's id: "session/object/7".
  if (const size_t slash = word.find('/'); slash != absl::string_view::npos && Known(word) == word) {
    std::string parts;
    for (const absl::string_view part : absl::StrSplit(word, '/'))
      absl::StrAppend(&parts, parts.empty() && part.data() == word.data() ? "" : "/",
                      IsSecret(part) ? Of(AliasKind::kSecret, part) : std::string(part));
    return absl::StrCat(parts, tail);
  }
  if (IsSecret(word)) return absl::StrCat(Of(AliasKind::kSecret, word), tail);
  return absl::StrCat(Known(word), tail);
}

std::string Aliases::Text(absl::string_view text) {
  // Names of several words first; none of them breaks a word of what is left.
  std::string whole;
  const bool several =
      std::any_of(learned_.begin(), learned_.end(), [](const auto& name) { return HasBreak(name.first); });
  if (several) whole = Known(text, /*of_words=*/true), text = whole;
  std::string result;
  for (size_t k = 0; k < text.size();) {
    if (IsBreak(text[k])) {
      result += text[k++];
      continue;
    }
    size_t end = k;
    while (end < text.size() && !IsBreak(text[end])) ++end;
    if (IsPath(text.substr(k, end - k))) end = EndOfPath(text, end);
    const absl::string_view word = text.substr(k, end - k);
    result += Word(word);
    k = end;
    const size_t at = word.find('@');
    const bool holder = at != absl::string_view::npos && at > 0 && !absl::StrContains(word, "://");
    if (!holder && !absl::StartsWith(word, "ipv4:") && !absl::StartsWith(word, "ipv6:")) continue;
    // Why, in somebody's words, or who the credentials say that it was.
    if (const size_t open = BracketBehind(text, k); open != absl::string_view::npos) {
      const size_t close = ClosingBracket(text, open);
      result += Text(text.substr(k, open - k));
      absl::StrAppend(&result, "(", Note(text.substr(open, close - open)), ")");
      k = std::min(close + 1, text.size());
    }
  }
  return result;
}

std::map<std::string, int> Aliases::Counts() const {
  std::map<std::string, int> counts;
  for (const auto& [kind, count] : count_)
    counts[absl::StrCat(NameOf(kind), kind == AliasKind::kHidden ? "" : "s")] = count;
  if (notes_ > 0) counts["notes"] = notes_;
  return counts;
}

}  // namespace touchstone::gateway::bundle
