#include "server/model/yaml/yaml_text.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>

namespace touchstone::model {

std::string QuotedYamlText(const std::string& text) {
  std::string quoted = "\"";
  for (const unsigned char c : text) {
    if (c == '"' || c == '\\')
      absl::StrAppend(&quoted, "\\", std::string(1, c));
    else if (c < 0x20 || c == 0x7F)
      absl::StrAppendFormat(&quoted, "\\x%02x", c);
    else
      quoted.push_back(c);
  }
  return quoted + "\"";
}

std::string YamlText(const std::string& text) {
  const std::string lower = absl::AsciiStrToLower(text);
  const bool word = !text.empty() && absl::ascii_isalpha(text[0]) &&
                    std::all_of(text.begin(), text.end(), [](unsigned char c) {
                      return absl::ascii_isalnum(c) || c == '_' || c == '-' || c == '.';
                    });
  const bool special = lower == "null" || lower == "true" || lower == "false" || lower == "yes" ||
                       lower == "no" || lower == "on" || lower == "off" || lower == "y" || lower == "n";
  return word && !special ? text : QuotedYamlText(text);
}

}  // namespace touchstone::model
