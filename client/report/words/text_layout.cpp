#include "client/report/words/text_layout.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

namespace touchstone::client {

int Columns(absl::string_view text) {
  int columns = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\033') {
      while (i < text.size() && text[i] != 'm') ++i;
    } else if ((text[i] & 0xC0) != 0x80) {
      ++columns;
    }
  }
  return columns;
}

int BarLength(double value, double largest, int full) {
  if (!(value > 0) || !(largest > 0)) return 0;
  return std::clamp(static_cast<int>(std::lround(value / largest * full)), 1, full);
}

std::string TextLayout::Styled(absl::string_view text, Style style) const {
  static const char* const kCodes[] = {"", "1", "2", "32", "33", "36"};
  if (!colour_ || style == kPlain || text.empty()) return std::string(text);
  return absl::StrCat("\033[", kCodes[style], "m", text, "\033[0m");
}

std::string TextLayout::LabelColumn() {
  std::string label = std::move(label_);
  label_.clear();
  const int blanks = std::max(1, kLabel - Columns(label));
  return absl::StrCat(Styled(label, kBold), std::string(label.empty() ? kLabel : blanks, ' '));
}

namespace {

// Words, a number and its unit as one.
std::vector<std::string> Words(absl::string_view text) {
  static const std::set<absl::string_view> kUnits = {"us", "ms", "s", "mm", "deg", "%", "mm/s", "1/m"};
  std::vector<std::string> words;
  for (absl::string_view word : absl::StrSplit(text, absl::ByAnyChar(" \n\t\r"), absl::SkipEmpty())) {
    const absl::string_view bare = word.substr(0, word.find_last_not_of(".,;:)") + 1);
    const bool unit = !words.empty() && absl::ascii_isdigit(words.back().back()) && kUnits.count(bare) > 0;
    if (unit) {
      absl::StrAppend(&words.back(), " ", word);
    } else {
      words.emplace_back(word);
    }
  }
  return words;
}

}  // namespace

std::vector<std::string> TextLayout::Wrap(absl::string_view text, int first, int rest) const {
  std::vector<std::string> lines;
  std::string line;
  for (const std::string& word : Words(text)) {
    const int room = lines.empty() ? first : rest;
    if (!line.empty() && Columns(line) + 1 + Columns(word) > room) {
      lines.push_back(std::move(line));
      line.clear();
    }
    absl::StrAppend(&line, line.empty() ? "" : " ", word);
  }
  lines.push_back(line);
  return lines;
}

void TextLayout::Lead(absl::string_view text, Style style) {
  for (const std::string& line : Wrap(text, width_, width_))
    absl::StrAppend(&text_, Styled(line, style), "\n");
}

void TextLayout::Paragraph(absl::string_view text, Style style, int hang) {
  int indent = 0;
  for (const std::string& line : Wrap(text, room(), room() - hang)) {
    absl::StrAppend(&text_, LabelColumn(), std::string(indent, ' '), Styled(line, style), "\n");
    indent = hang;
  }
}

void TextLayout::Verbatim(absl::string_view text) {
  for (absl::string_view line : absl::StrSplit(text, '\n')) {
    if (!line.empty()) absl::StrAppend(&text_, LabelColumn(), "  ", line, "\n");
  }
}

void TextLayout::Rows(const std::vector<std::vector<Cell>>& rows) {
  // Every column but the last is as wide as its widest cell.
  std::vector<int> widths;
  for (const auto& row : rows) {
    if (widths.size() < row.size()) widths.resize(row.size(), 0);
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], Columns(row[i].text));
  }
  int before_last = 0;
  for (size_t i = 0; i + 1 < widths.size(); ++i) before_last += widths[i] > 0 ? widths[i] + 2 : 0;
  if (before_last > room()) {
    // No room for columns: each row is a paragraph.
    for (const auto& row : rows) {
      std::string text;
      for (const Cell& cell : row)
        absl::StrAppend(&text, text.empty() || cell.text.empty() ? "" : ", ", cell.text);
      if (!text.empty()) Paragraph(text, row.front().style, 2);
    }
    return;
  }
  const bool last_fits = widths.empty() || before_last + widths.back() <= room();
  const bool last_wraps_beside = room() - before_last >= 28;

  for (const auto& row : rows) {
    std::string line;
    for (size_t i = 0; i < row.size(); ++i) {
      const bool last = i + 1 == widths.size();
      const Cell& cell = row[i];
      if (widths[i] == 0) continue;
      if (last && !last_fits) {
        const int indent = last_wraps_beside ? before_last : 2;
        const auto lines = Wrap(cell.text, room() - indent, room() - indent);
        if (!last_wraps_beside) {
          absl::StrAppend(&text_, LabelColumn(), line.substr(0, line.find_last_not_of(' ') + 1), "\n");
          line.clear();
        }
        for (size_t k = 0; k < lines.size(); ++k) {
          if (lines[k].empty()) continue;
          if (k > 0) absl::StrAppend(&text_, LabelColumn(), line, "\n");
          if (k > 0 || !last_wraps_beside) line = std::string(indent, ' ');
          absl::StrAppend(&line, Styled(lines[k], cell.style));
        }
        continue;
      }
      const std::string blanks(widths[i] - Columns(cell.text), ' ');
      const std::string text = Styled(cell.text, cell.style);
      absl::StrAppend(&line, cell.right ? blanks : "", text, cell.right ? "" : blanks, last ? "" : "  ");
    }
    if (line.empty()) continue;
    absl::StrAppend(&text_, LabelColumn(), line.substr(0, line.find_last_not_of(' ') + 1), "\n");
  }
}

}  // namespace touchstone::client
