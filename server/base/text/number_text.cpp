// What people and their programs write where a number should stand.
#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/strip.h>

#include <algorithm>

#include "server/base/text/text.h"

namespace touchstone {
namespace {

constexpr absl::string_view kMinusSigns[] = {"\xE2\x88\x92", "\xE2\x80\x93"};  // minus, en dash
constexpr absl::string_view kNoBreakSpaces[] = {"\xC2\xA0", "\xE2\x80\xAF", "\xE2\x80\x89"};
constexpr size_t kMaxShown = 48;

// The first letters of the months' names in English, German, French, Spanish and Italian, in lower case.
constexpr absl::string_view kMonths[] = {
    "jan", "f\u00E9v", "feb", "fev", "mar", "m\u00E4r", "mrz", "apr", "avr",      "abr", "may", "mai",
    "mag", "jun",      "jui", "giu", "jul", "lug",      "aug", "aou", "ao\u00FB", "ago", "sep", "set",
    "oct", "okt",      "ott", "nov", "dec", "d\u00E9c", "dez", "dic", "ene",      "gen"};

bool NamesAMonth(absl::string_view text) {
  const std::string lower = absl::AsciiStrToLower(text);
  return std::any_of(std::begin(kMonths), std::end(kMonths), [&](absl::string_view month) {
    const size_t at = lower.find(month.data(), 0, month.size());
    // A day or a year stands beside it.
    return at != std::string::npos && (at == 0 || !absl::ascii_isalpha(lower[at - 1])) &&
           std::any_of(lower.begin(), lower.end(), absl::ascii_isdigit);
  });
}

// 22.05.2026, 2026-05-22, 5/22, 22.5. or 12:30:00, also both.
bool IsDateOrTimeOfDigits(absl::string_view text) {
  int groups = 0;
  bool in_digits = false, slashes = false, colons = false, dots_or_dashes = false;
  for (const char c : text) {
    const bool digit = absl::ascii_isdigit(c);
    groups += digit && !in_digits;
    in_digits = digit;
    slashes = slashes || c == '/';
    colons = colons || c == ':';
    dots_or_dashes = dots_or_dashes || c == '.' || c == '-';
    if (!digit && !absl::StrContains("/:.- T", absl::string_view(&c, 1))) return false;
  }
  if (text.empty() || !absl::ascii_isdigit(text[0])) return false;
  const bool two_and_a_dot = groups == 2 && text.back() == '.';
  return ((slashes || colons) && groups >= 2) || (dots_or_dashes && groups >= 3) || two_and_a_dot;
}

}  // namespace

bool NextLine(absl::string_view* rest, absl::string_view* line) {
  if (rest->empty()) return false;
  absl::ConsumePrefix(rest, "\xEF\xBB\xBF");
  const size_t end = std::min(rest->find_first_of("\r\n"), rest->size());
  *line = rest->substr(0, end);
  const bool two = absl::StartsWith(rest->substr(end), "\r\n");
  rest->remove_prefix(std::min(end + (two ? 2 : 1), rest->size()));
  return true;
}

std::string WithPlainSigns(absl::string_view number) {
  for (bool taken = true; taken;) {
    taken = false;
    for (const absl::string_view space : kNoBreakSpaces)
      taken = absl::ConsumePrefix(&number, space) || absl::ConsumeSuffix(&number, space) || taken;
  }
  std::string plain(number);
  for (const absl::string_view sign : kMinusSigns) {
    if (absl::StartsWith(plain, sign)) plain.replace(0, sign.size(), "-");
    plain = absl::StrReplaceAll(plain, {{absl::StrCat("e", sign), "e-"}, {absl::StrCat("E", sign), "E-"}});
  }
  return plain;
}

std::string WhyNoNumber(absl::string_view text) {
  const std::string shown = absl::StrCat("'", absl::Utf8SafeCHexEscape(text.substr(0, kMaxShown)),
                                         text.size() > kMaxShown ? "...'" : "'");
  if (text.size() <= kMaxShown && (NamesAMonth(text) || IsDateOrTimeOfDigits(text)))
    return absl::StrCat(
        shown,
        " is a date or a time, into which spreadsheets turn numbers like 22.5; the number was expected: "
        "format the cells as numbers before it is entered, and write the file again");
  const size_t comma = text.find(',');
  std::string with_point = WithPlainSigns(text);
  std::replace(with_point.begin(), with_point.end(), ',', '.');
  double ignored;
  if (comma != absl::string_view::npos && absl::SimpleAtod(with_point, &ignored))
    return absl::StrCat(shown, " has a comma; ", with_point, " was expected, with a decimal point");
  return absl::StrCat(shown, " is not a number; one like 12.5 was expected");
}

}  // namespace touchstone
