// One line of a CSV file as its fields (RFC 4180).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::session {

// Cuts a line at its commas. A field in quotes may hold commas and doubled quotes, but no line end.
class CsvFields {
 public:
  // Views into `line`, or into this object where a field was quoted; they last until the next call.
  absl::Status Cut(absl::string_view line);
  const std::vector<absl::string_view>& all() const { return fields_; }

 private:
  // Returns where the comma behind the field stands, or the end of the line.
  absl::StatusOr<size_t> CutQuoted(absl::string_view line, size_t start, size_t number);

  std::vector<absl::string_view> fields_;
  std::vector<std::unique_ptr<std::string>> unquoted_;
};

// Valid UTF-8 without control characters: names go into messages and reports.
bool IsText(absl::string_view text);

}  // namespace touchstone::session
