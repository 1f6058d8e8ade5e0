#include "server/base/text/whole_number.h"

#include <limits>

#include <absl/strings/ascii.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

namespace touchstone {
namespace {

constexpr int kMaxExponent = 19;  // 10^20 is above 2^64

bool IsDigits(absl::string_view text) {
  for (const char c : text)
    if (!absl::ascii_isdigit(static_cast<unsigned char>(c))) return false;
  return true;
}

// The digits without an underscore between two of them; empty where one stands elsewhere.
std::string WithoutSeparators(absl::string_view text) {
  std::string digits;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '_') {
      digits += text[i];
      continue;
    }
    if (i == 0 || i + 1 == text.size() || text[i + 1] == '_' || !IsDigits(text.substr(i - 1, 1)) ||
        !IsDigits(text.substr(i + 1, 1)))
      return "";
  }
  return digits;
}

}  // namespace

absl::StatusOr<uint64_t> ParseWholeNumber(absl::string_view text) {
  const absl::Status wrong = absl::InvalidArgumentError(
      absl::StrCat("'", text, "' is no whole number from 0 on; one like 1000, 1_000 or 1e3 was expected"));
  const absl::Status too_large = absl::OutOfRangeError(
      absl::StrCat("'", text, "' is too large; at most ", std::numeric_limits<uint64_t>::max()));
  std::string digits = WithoutSeparators(text);
  int exponent = 0;
  if (const size_t e = digits.find_first_of("eE"); e != std::string::npos) {
    absl::string_view power = absl::string_view(digits).substr(e + 1);
    if (!power.empty() && power[0] == '+') power.remove_prefix(1);
    if (power.empty() || !IsDigits(power)) return wrong;
    if (!absl::SimpleAtoi(power, &exponent) || exponent > kMaxExponent) return too_large;
    digits.resize(e);
  }
  if (const size_t point = digits.find('.'); point != std::string::npos) {
    std::string fraction = digits.substr(point + 1);
    while (!fraction.empty() && fraction.back() == '0') fraction.pop_back();
    exponent -= static_cast<int>(fraction.size());
    digits = digits.substr(0, point) + fraction;
    if (point == 0 || exponent < 0) return wrong;
  }
  if (digits.empty() || !IsDigits(digits)) return wrong;
  digits.append(static_cast<size_t>(exponent), '0');
  uint64_t value = 0;
  if (!absl::SimpleAtoi(digits, &value)) return too_large;
  return value;
}

}  // namespace touchstone
