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

// Takes the next line off the front of `rest`, without its end (\n, \r\n or \r) and without a byte-order mark, which stands
// wherever a file that others were put together from begins. False: nothing is left.
bool NextLine(absl::string_view* rest, absl::string_view* line);

// The number without what typesetting puts around it: U+2212 and U+2013 in the place of a sign are '-', no-break spaces at
// both ends are none.
std::string WithPlainSigns(absl::string_view number);

// Why a text that is no number is none, and what would be right: "'22.Mai' is a date, ...", "'1,5' has a comma ...",
// "'x' is not a number; one like 12.5 was expected".
std::string WhyNoNumber(absl::string_view text);

// The whole of `text` as a finite number, with the signs that WithPlainSigns takes; an error says what was found.
absl::StatusOr<double> ParseNumber(absl::string_view text);

// Reads a whole file of at most `limit_bytes`; the error names the path and why.
absl::StatusOr<std::string> ReadFile(const std::string& path, uint64_t limit_bytes = uint64_t{1} << 32);

}  // namespace touchstone
