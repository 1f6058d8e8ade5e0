// One line of a CSV file as its fields (RFC 4180).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::session {

// Cuts a line at its separators, commas unless said otherwise. A field in quotes may hold separators and doubled quotes, but
// no line end.
class CsvFields {
 public:
  explicit CsvFields(char separator = ',') : separator_(separator) {}

  // Views into `line`, or into this object where a field was quoted; they last until the next call. INVALID_ARGUMENT for a
  // line of more than 65,536 fields, which are no longer cut.
  absl::Status Cut(absl::string_view line);
  const std::vector<absl::string_view>& all() const { return fields_; }

 private:
  // Returns where the separator behind the field stands, or the end of the line.
  absl::StatusOr<size_t> CutQuoted(absl::string_view line, size_t start, size_t number);

  char separator_;
  std::vector<absl::string_view> fields_;
  std::vector<std::unique_ptr<std::string>> unquoted_;
};

// The lines of a CSV file, header first, whichever way they end, in the plain form (plain_csv.h).
class CsvLines {
 public:
  // INVALID_ARGUMENT where the file is not certain to mean one thing, with the line and column. A byte-order mark, with which
  // files from spreadsheets begin, is skipped.
  static absl::StatusOr<CsvLines> Open(absl::string_view text, const std::string& origin);
  // False at the end. Lines are counted from 1 as they stand in the file.
  bool Next(absl::string_view* line);
  int number() const { return number_; }
  size_t left() const;  // lines to come, at most: empty ones count

 private:
  std::shared_ptr<const std::string> converted_;  // what rest_ looks at, where the file is not plain
  absl::string_view rest_;
  int number_ = 0;
};

// The header's names, read into `fields` from the first line; INVALID_ARGUMENT with the line where there is none, or one of
// more columns than `max_columns`. `example`: how a header begins.
absl::StatusOr<std::vector<std::string>> ReadCsvHeader(const std::string& origin, absl::string_view example,
                                                       size_t max_columns, CsvLines* lines,
                                                       CsvFields* fields);

// The number that a field holds, infinities and NaN among them: whether those are right depends on the column. The
// error says what the field is and what was expected, not where.
absl::StatusOr<double> FieldNumber(absl::string_view field);

// A field for a file: in quotes where a reader would take it apart.
std::string QuotedField(const std::string& field);

// A field for a message: its start if it is long, bytes that are no text escaped.
std::string Shown(absl::string_view field);

// Valid UTF-8 without control characters: names go into messages and reports.
bool IsText(absl::string_view text);

}  // namespace touchstone::session
