// Counts and seeds as people write them.
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone {

// "1000", "1_000_000", "1e6", "2.5e3"; a whole number from 0 to 2^64 - 1. INVALID_ARGUMENT says what is wrong with the text;
// OUT_OF_RANGE: it is larger.
// "010" is ten, and "-1" is refused (CLI11 would take 8 and 2^64 - 1).
absl::StatusOr<uint64_t> ParseWholeNumber(absl::string_view text);

}  // namespace touchstone
