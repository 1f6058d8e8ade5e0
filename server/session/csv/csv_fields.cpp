#include "server/session/csv/csv_fields.h"

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <charconv>
#include <cstdint>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/csv/plain_csv.h"

namespace touchstone::session {
namespace {

constexpr size_t kMaxShown = 48;
constexpr size_t kMaxFields = 65'536;

}  // namespace

absl::StatusOr<CsvLines> CsvLines::Open(absl::string_view text, const std::string& origin) {
  CsvLines lines;
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<PlainCsv> plain, ConvertToPlainCsv(text, origin));
  if (plain) {
    lines.converted_ = std::make_shared<const std::string>(std::move(plain->text));
    lines.number_ = plain->skipped_lines;
    text = *lines.converted_;
  }
  lines.rest_ = text;
  return lines;
}

bool CsvLines::Next(absl::string_view* line) {
  if (!NextLine(&rest_, line)) return false;
  ++number_;
  return true;
}

size_t CsvLines::left() const {
  return std::count_if(rest_.begin(), rest_.end(), [](char c) { return c == '\n' || c == '\r'; }) + 1;
}

absl::StatusOr<std::vector<std::string>> ReadCsvHeader(const std::string& origin, absl::string_view example,
                                                       size_t max_columns, CsvLines* lines,
                                                       CsvFields* fields) {
  const auto wrong = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ":", lines->number(), ": ", what));
  };
  absl::string_view header;
  const bool any = lines->Next(&header);
  if (!any)
    return absl::InvalidArgumentError(absl::StrCat(origin, ":1: a header line was expected (", example, ")"));
  if (absl::StripAsciiWhitespace(header).empty())
    return wrong(absl::StrCat("a header line was expected (", example, ")"));
  if (absl::Status status = fields->Cut(header); !status.ok()) return wrong(status.message());
  const size_t columns = fields->all().size();
  if (columns > max_columns)
    return wrong(absl::StrCat("has ", columns, " columns; at most ", max_columns, " are read"));
  return std::vector<std::string>(fields->all().begin(), fields->all().end());
}

absl::StatusOr<double> FieldNumber(absl::string_view field) {
  if (field.empty()) return absl::InvalidArgumentError("is empty; a number was expected");
  double value = 0;
  const auto reads = [&value](absl::string_view digits) {
    const bool doubled_sign = digits.size() > 1 && digits[0] == '+' && (digits[1] == '-' || digits[1] == '+');
    if (digits[0] == '+') digits.remove_prefix(1);
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return end != digits.data() + digits.size() || doubled_sign ? std::errc::invalid_argument : error;
  };
  std::errc error = reads(field);
  if (error == std::errc::invalid_argument) error = reads(WithPlainSigns(field));
  if (error == std::errc::result_out_of_range)
    return absl::InvalidArgumentError(absl::StrCat("'", Shown(field), "' is beyond what a double holds"));
  if (error != std::errc()) return absl::InvalidArgumentError(WhyNoNumber(field));
  return value;
}

std::string QuotedField(const std::string& field) {
  if (field.find_first_of(",\"") == std::string::npos) return field;
  return absl::StrCat("\"", absl::StrReplaceAll(field, {{"\"", "\"\""}}), "\"");
}

std::string Shown(absl::string_view field) {
  const bool cut = field.size() > kMaxShown;
  return absl::StrCat(absl::CHexEscape(field.substr(0, kMaxShown)), cut ? "..." : "");
}

bool IsText(absl::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const int more = byte < 0x80         ? 0
                     : (byte >> 5) == 6  ? 1
                     : (byte >> 4) == 14 ? 2
                     : (byte >> 3) == 30 ? 3
                                         : -1;
    if (more < 0 || byte < 0x20 || byte == 0x7F || i + more >= text.size() + (more == 0)) return false;
    uint32_t code = more == 0 ? byte : byte & (0x3F >> more);
    for (int k = 1; k <= more; ++k) {
      const auto next = static_cast<unsigned char>(text[i + k]);
      if ((next >> 6) != 2) return false;
      code = code << 6 | (next & 0x3F);
    }
    constexpr uint32_t kSmallest[] = {0, 0x80, 0x800, 0x10000};
    if (code < kSmallest[more] || code > 0x10FFFF || (code >= 0xD800 && code <= 0xDFFF)) return false;
    i += more + 1;
  }
  return true;
}

absl::Status CsvFields::Cut(absl::string_view line) {
  fields_.clear();
  size_t quoted = 0;
  for (size_t begin = 0;;) {
    if (fields_.size() >= kMaxFields)
      return absl::InvalidArgumentError(absl::StrCat("has more than ", kMaxFields, " fields"));
    size_t start = begin;
    while (start < line.size() && line[start] != separator_ && (line[start] == ' ' || line[start] == '\t'))
      ++start;
    if (start < line.size() && line[start] == '"') {
      TOUCHSTONE_ASSIGN_OR_RETURN(const size_t end, CutQuoted(line, start, quoted++));
      if (end == line.size()) break;
      begin = end + 1;
      continue;
    }
    const size_t comma = std::min(line.find(separator_, begin), line.size());
    fields_.push_back(absl::StripAsciiWhitespace(line.substr(begin, comma - begin)));
    if (comma == line.size()) break;
    begin = comma + 1;
  }
  return absl::OkStatus();
}
absl::StatusOr<size_t> CsvFields::CutQuoted(absl::string_view line, size_t start, size_t number) {
  if (number == unquoted_.size()) unquoted_.push_back(std::make_unique<std::string>());
  std::string& text = *unquoted_[number];
  text.clear();
  size_t i = start + 1;
  for (;; ++i) {
    if (i >= line.size())
      return absl::InvalidArgumentError(absl::StrCat(
          "field ", fields_.size() + 1, " begins with a quote (\") and has no closing one on its line"));
    if (line[i] != '"') {
      text += line[i];
    } else if (i + 1 < line.size() && line[i + 1] == '"') {
      text += line[i++];
    } else {
      break;
    }
  }
  const size_t comma = std::min(line.find(separator_, i + 1), line.size());
  if (!absl::StripAsciiWhitespace(line.substr(i + 1, comma - i - 1)).empty())
    return absl::InvalidArgumentError(
        absl::StrCat("field ", fields_.size() + 1, " goes on after its closing quote with '",
                     Shown(line.substr(i + 1, comma - i - 1)), "'; a separator was expected"));
  fields_.push_back(absl::StripAsciiWhitespace(text));
  return comma;
}

}  // namespace touchstone::session
