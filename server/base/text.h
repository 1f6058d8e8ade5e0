// Small helpers for messages, hashes and numbers in text.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone {

// ", did you mean 'tip_radius'?" if one of `known` is close to `word` (edit distance, prefix), else
// "; known: a, b, c" (at most 12 names). For the end of an error message.
std::string DidYouMean(absl::string_view word, const std::vector<std::string>& known);

// SHA-256 of `data` as 64 lower-case hexadecimal digits.
std::string Sha256Hex(absl::string_view data);
// Of pieces one after the other.
std::string Sha256Hex(const std::vector<absl::string_view>& pieces);

// SHA-256 of a file's bytes, read in blocks.
absl::StatusOr<std::string> Sha256HexOfFile(const std::string& path);

// The shortest decimal text that reads back as the same double ("0.1", "1e-09", "nan").
std::string ShortestNumber(double value);

// A duration for people, rounded up to whole seconds: "40 s", "4 min 10 s", "2 h 5 min". Below 0 is 0.
std::string DurationInWords(double seconds);

// The whole of `text` as a number; an error says what was found. Accepts inf and nan only if allowed.
absl::StatusOr<double> ParseNumber(absl::string_view text);

// Reads a whole file of at most `limit_bytes`; the error names the path and why.
absl::StatusOr<std::string> ReadFile(const std::string& path, uint64_t limit_bytes = uint64_t{1} << 32);

}  // namespace touchstone
