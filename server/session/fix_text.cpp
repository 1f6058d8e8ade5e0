#include "server/session/fix_text.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>

namespace touchstone::session {

std::string ShellWord(const std::string& word) {
  const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
    return absl::ascii_isalnum(c) || absl::StrContains("_-./=,", absl::string_view(&c, 1));
  });
  if (plain) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::vector<std::string> RawFields(absl::string_view line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') quoted = !quoted;
    if (c == ',' && !quoted) {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  return fields;
}

std::vector<std::string> RenameOptions(const std::vector<std::pair<std::string, std::string>>& renames) {
  if (renames.size() == 2 && renames[0].first == renames[1].second && renames[0].second == renames[1].first)
    return {"--swap-objects " + ShellWord(absl::StrCat(renames[0].first, ",", renames[1].first))};
  std::vector<std::string> options;
  for (const auto& [from, to] : renames)
    options.push_back("--rename-object " + ShellWord(absl::StrCat(from, "=", to)));
  return options;
}

}  // namespace touchstone::session
