#include "client/report/words/error_scale.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

namespace touchstone::client {

// Three figures of grey levels, but never finer than a hundredth of one; three of pixels.
std::string ErrorScale::Plain(double error) const {
  const double size = std::abs(error);
  if (std::isnan(error)) return "n/a";
  return kind_ == v1::DataReport::BOARDS ? Number(error)
                                         : Fixed(error, size < 9.995   ? 2
                                                        : size < 99.95 ? 1
                                                                       : 0);
}

const char* ErrorScale::Symbol() const {
  return kind_ == v1::DataReport::BOARDS ? "px" : "grey";
}

std::string ErrorScale::Text(double error) const {
  return IsTime() ? Time(error) : absl::StrCat(Plain(error), " ", Symbol());
}

std::string ErrorScale::Signed(double error) const {
  return IsTime() ? SignedTime(error) : absl::StrCat(error > 0 ? "+" : "", Plain(error), " ", Symbol());
}

std::string ErrorScale::Change(double from, double to) const {
  return IsTime() ? TimeChange(from, to) : absl::StrCat(Plain(from), " -> ", Plain(to), " ", Symbol());
}

TimeUnit ErrorScale::UnitFor(double size) const {
  if (IsTime()) return UnitOfTime(size);
  return {1, kind_ == v1::DataReport::BOARDS ? "px" : "grey levels"};
}

}  // namespace touchstone::client
