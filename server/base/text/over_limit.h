// Errors of requests that ask for more than a configured limit.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>

namespace touchstone {

// Whole numbers in full, 20000 instead of 2e+04; others as ShortestNumber.
std::string LimitInWords(double value);

// RESOURCE_EXHAUSTED: "touches has 30000: at most 20000 (max_touches_per_request)", of `asked` "touches has". The
// request itself is too large: waiting does not help.
absl::Status OverLimit(absl::string_view asked, const absl::AlphaNum& value, absl::string_view limit_name,
                       double limit);

// RESOURCE_EXHAUSTED: "256 dataset streams run already (max_streams = 256): try again later, or at another one". Others use
// what there is; clients know by "try again" that waiting helps.
absl::Status Busy(absl::string_view what, absl::string_view limit_name, double limit);

// RESOURCE_EXHAUSTED: "there is not enough memory for this request: try again later".
absl::Status NoMemoryFor(absl::string_view what);

}  // namespace touchstone
