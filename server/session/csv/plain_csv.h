// CSV files as spreadsheets and other programs write them, in the plain form that the readers take: UTF-8, commas, decimal
// points, '-' for minus.
//
// Read where it is certain: UTF-16; a first line sep=; semicolons, tabs or bars between fields where the header has no comma;
// decimal commas where some number of the file can have no other meaning and none has a point; Unicode minus signs. Refused
// with line and column where it is not: commas that may part thousands, and a last line without an end whose last field may
// be cut off.
#pragma once

#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::session {

struct PlainCsv {
  std::string text;       // with the file's line ends
  int skipped_lines = 0;  // before the header: 1 where sep= stands there
};

// Nothing where the file is plain already, for the readers: they take Unicode minus signs, every line end and a byte-order
// mark. `thorough`: those are replaced too, and something is always returned.
absl::StatusOr<std::optional<PlainCsv>> ConvertToPlainCsv(absl::string_view csv, const std::string& origin,
                                                          bool thorough = false);

}  // namespace touchstone::session
