#include "server/base/text/wrapped_text.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace touchstone {
namespace {

constexpr int kWidthOfNoTerminal = 110;
constexpr int kMinWidth = 60, kMaxWidth = 160;
constexpr int kMaxTextWidth = 110;

}  // namespace

int TerminalWidth() {
  const char* const columns = std::getenv("COLUMNS");
  int width = 0;
  if (columns != nullptr && absl::SimpleAtoi(columns, &width) && width > 0)
    return std::clamp(width, kMinWidth, kMaxWidth);
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kWidthOfNoTerminal;
  return std::clamp<int>(size.ws_col, kMinWidth, kMaxWidth);
}

size_t TextWidth() {
  return static_cast<size_t>(std::min(TerminalWidth(), kMaxTextWidth));
}

std::string Wrap(absl::string_view text, size_t width, size_t indent) {
  std::string result;
  size_t column = indent;
  std::vector<absl::string_view> words = absl::StrSplit(text, ' ', absl::SkipEmpty());
  for (size_t k = 0; k < words.size(); ++k) {
    // A word that no line has room for is broken behind a comma or a bar.
    if (indent + words[k].size() > width) {
      const size_t room = width - std::min(width, indent);
      if (const size_t at = words[k].substr(0, room).find_last_of(",|"); at != absl::string_view::npos) {
        const absl::string_view rest = words[k].substr(at + 1);
        words[k] = words[k].substr(0, at + 1);
        words.insert(words.begin() + static_cast<std::ptrdiff_t>(k) + 1, rest);
      }
    }
    const absl::string_view word = words[k];
    if (column > indent && column + 1 + word.size() > width) {
      absl::StrAppend(&result, "\n", std::string(indent, ' '));
      column = indent;
    } else if (column > indent) {
      result += ' ';
      ++column;
    }
    absl::StrAppend(&result, word);
    column += word.size();
  }
  return result;
}

}  // namespace touchstone
