// A measurement file fixed as text, so that what does not change keeps its bytes.
#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/strip.h>

#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/csv/fix_text.h"
#include "server/session/csv/plain_csv.h"
#include "server/session/measurements/measurement_columns.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::session {
namespace {

// The number of a field that a fix may change, in SI.
double ValueOf(const MeasurementSet& set, const Column& column, int row) {
  switch (column.kind) {
    case ColumnKind::kSpeed:
      return set.speed_m_s[row];
    case ColumnKind::kStandoff:
      return set.standoff_m[row];
    case ColumnKind::kTarget:
      return set.target_m[row][column.index];
    case ColumnKind::kApproach:
      return set.approach[row][column.index];
    case ColumnKind::kLateral:
      return set.lateral[row][column.index];
    case ColumnKind::kTime:
      return set.TimeS(row, column.index);
    default:
      return 0;
  }
}

// Twelve digits: what a product of decimal numbers adds behind them is rounding.
std::string Digits(Unit unit, double value_si) {
  return absl::StrFormat("%.12g", FromSi(unit, value_si));
}

std::string NumberText(const Column& column, double value) {
  if (std::isnan(value)) return "";
  switch (column.kind) {
    case ColumnKind::kSpeed:
      return Digits(Unit::kMillimetrePerSecond, value);
    case ColumnKind::kStandoff:
    case ColumnKind::kTarget:
      return Digits(Unit::kMillimetre, value);
    case ColumnKind::kTime:
      return Digits(Unit::kMicrosecond, value);
    default:
      return ShortestNumber(value);
  }
}

std::string WithOtherSign(absl::string_view number) {
  number = absl::StripAsciiWhitespace(number);
  if (absl::ConsumePrefix(&number, "-")) return std::string(number);
  absl::ConsumePrefix(&number, "+");
  return absl::StrCat("-", number);
}

std::string QuotedName(const std::string& name) {
  if (name.find_first_of(",\"") == std::string::npos) return name;
  return absl::StrCat("\"", absl::StrReplaceAll(name, {{"\"", "\"\""}}), "\"");
}

bool SameNumber(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

// The fields of a row as they are to be. A number that stood in another column of the same kind, but for its sign,
// keeps its digits.
void MendRow(const Columns& columns, const MeasurementSet& before, int old_row, const MeasurementSet& after,
             int new_row, std::vector<std::string>* fields) {
  const std::vector<std::string> old = *fields;
  for (size_t i = 0; i < columns.all.size(); ++i) {
    const Column& column = columns.all[i];
    if (column.kind == ColumnKind::kObject) {
      const std::string& name = after.objects[after.object[new_row]];
      if (name != before.objects[before.object[old_row]]) (*fields)[i] = QuotedName(name);
      continue;
    }
    const double value = ValueOf(after, column, new_row);
    if (SameNumber(value, ValueOf(before, column, old_row))) continue;
    std::string text = NumberText(column, value);
    for (size_t j = 0; j < columns.all.size() && !std::isnan(value); ++j) {
      if (columns.all[j].kind != column.kind) continue;
      const double other = ValueOf(before, columns.all[j], old_row);
      if (other == value)
        text = std::string(absl::StripAsciiWhitespace(old[j]));
      else if (other == -value)
        text = WithOtherSign(old[j]);
    }
    (*fields)[i] = text;
  }
}

}  // namespace

absl::StatusOr<std::string> FixMeasurementFile(absl::string_view csv, const std::string& origin,
                                               const MeasurementFix& fix) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<PlainCsv> plain,
                              ConvertToPlainCsv(csv, origin, fix.plain_text));
  if (plain) csv = plain->text;
  TOUCHSTONE_ASSIGN_OR_RETURN(const MeasurementSet before, ParseMeasurementSet(csv, origin));
  MeasurementSet after = before;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int> left, ApplyFix(fix, &after));

  std::string text;
  const std::vector<absl::string_view> lines = LinesWithEnds(csv);
  absl::string_view header = lines[0];
  text.append(header.data(), header.size());
  absl::ConsumePrefix(&header, "\xEF\xBB\xBF");
  CsvFields names;
  TOUCHSTONE_RETURN_IF_ERROR(names.Cut(absl::StripTrailingAsciiWhitespace(header)));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const Columns columns,
      ReadColumns(std::vector<std::string>(names.all().begin(), names.all().end()), origin));

  for (size_t row = 0; row < left.size(); ++row) {
    const absl::string_view line = lines[before.line[left[row]] - 1];
    const absl::string_view content = absl::StripTrailingAsciiWhitespace(line);
    // An empty last field is no white space to strip.
    std::vector<std::string> fields = RawFields(content);
    MendRow(columns, before, left[row], after, static_cast<int>(row), &fields);
    for (size_t i = 0; i < fields.size(); ++i) absl::StrAppend(&text, i > 0 ? "," : "", fields[i]);
    const absl::string_view end = line.substr(content.size());
    text.append(end.empty() ? "\n" : std::string(end));
  }
  return text;
}

}  // namespace touchstone::session
