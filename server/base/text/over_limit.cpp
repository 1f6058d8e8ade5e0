#include "server/base/text/over_limit.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <cstdint>

#include "server/base/text/text.h"

namespace touchstone {

std::string LimitInWords(double value) {
  if (std::abs(value) < 1e15 && value == std::floor(value)) return absl::StrCat(static_cast<int64_t>(value));
  return ShortestNumber(value);
}

absl::Status OverLimit(absl::string_view asked, const absl::AlphaNum& value, absl::string_view limit_name,
                       double limit) {
  return absl::ResourceExhaustedError(
      absl::StrCat(asked, " ", value, ": at most ", LimitInWords(limit), " (", limit_name, ")"));
}

absl::Status Busy(absl::string_view what, absl::string_view limit_name, double limit) {
  return absl::ResourceExhaustedError(absl::StrCat(what, " already (", limit_name, " = ", LimitInWords(limit),
                                                   "): try again later, or at another one"));
}

absl::Status NoMemoryFor(absl::string_view what) {
  return absl::ResourceExhaustedError(
      absl::StrCat("there is not enough memory for this ", what, ": try again later"));
}

}  // namespace touchstone
