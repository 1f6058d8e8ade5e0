#include "client/report/error_scale.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

namespace touchstone::client {
namespace {

// Three figures, but never finer than a hundredth of a grey level.
std::string GreyNumber(double grey) {
  const double size = std::abs(grey);
  return std::isnan(grey) ? "n/a" : Fixed(grey, size < 9.995 ? 2 : size < 99.95 ? 1 : 0);
}

}  // namespace

std::string ErrorScale::Text(double error) const {
  return grey_ ? absl::StrCat(GreyNumber(error), " grey") : Time(error);
}

std::string ErrorScale::Signed(double error) const {
  return grey_ ? absl::StrCat(error > 0 ? "+" : "", GreyNumber(error), " grey") : SignedTime(error);
}

std::string ErrorScale::Change(double from, double to) const {
  return grey_ ? absl::StrCat(GreyNumber(from), " -> ", GreyNumber(to), " grey") : TimeChange(from, to);
}

}  // namespace touchstone::client
