#include "server/base/text/value_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

namespace touchstone {

int DecimalsFor(double value, int digits) {
  if (!(std::abs(value) > 0) || !std::isfinite(value)) return 0;
  // The exponent after rounding: 0.9996 with three digits is 1.00.
  char text[40];
  std::snprintf(text, sizeof(text), "%.*e", digits - 1, value);
  const int exponent = std::atoi(std::strchr(text, 'e') + 1);
  return std::clamp(digits - 1 - exponent, 0, 9);
}

namespace {

constexpr int kMaxDigits = 7;  // beyond them nobody reads a value, however small its error

// "3e-9" rather than "3e-09".
std::string ShortExponent(std::string text) {
  const size_t e = text.find('e');
  if (e == std::string::npos) return text;
  size_t digit = e + 2;
  while (digit + 1 < text.size() && text[digit] == '0') text.erase(digit, 1);
  if (text[e + 1] == '+') text.erase(e + 1, 1);
  return text;
}

// Decimals of a value so that its error shows one digit, or two if that digit is a 1.
int DecimalsForError(double error) {
  const int decimals = DecimalsFor(error, 1);
  return error * std::pow(10.0, decimals) < 1.95 ? DecimalsFor(error, 2) : decimals;
}

}  // namespace

std::string FixedNumber(double value, int decimals) {
  if (std::isnan(value)) return "n/a";
  std::string text = absl::StrFormat("%.*f", decimals, value);
  if (text[0] == '-' && text.find_first_of("123456789") == std::string::npos) text.erase(0, 1);
  return text;
}

std::string RoundedNumber(double value, int digits) {
  if (std::isnan(value)) return "n/a";
  if (std::isinf(value)) return value > 0 ? "infinite" : "-infinite";
  const double size = std::abs(value);
  if (size == 0) return "0";
  if (size < 1e-4 || size >= 1e7) {
    char text[40];
    std::snprintf(text, sizeof(text), "%.*g", digits, value);
    return ShortExponent(text);
  }
  return FixedNumber(value, DecimalsFor(value, digits));
}

std::string RoundNumber(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return ShortExponent(text);
}

std::string ValueWithError(double value, double error) {
  if (!(error > 1e-9) || !std::isfinite(error) || error >= 1e7)
    return error == 0 ? RoundNumber(value) : RoundedNumber(value, 3);
  const int decimals = DecimalsForError(error);
  const int shown = std::min(decimals, DecimalsFor(std::max(std::abs(value), error), kMaxDigits));
  return absl::StrCat(FixedNumber(value, shown), " +- ",
                      shown == decimals ? FixedNumber(error, decimals) : RoundedNumber(error, 2));
}

}  // namespace touchstone
