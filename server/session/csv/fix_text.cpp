#include "server/session/csv/fix_text.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/text/text.h"

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

std::vector<absl::string_view> LinesWithEnds(absl::string_view text) {
  std::vector<absl::string_view> lines;
  for (absl::string_view rest = text, line; NextLine(&rest, &line);) {
    const size_t begin = lines.empty() ? 0 : lines.back().data() + lines.back().size() - text.data();
    lines.push_back(text.substr(begin, text.size() - rest.size() - begin));
  }
  return lines;
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
