#include "server/session/csv/plain_csv.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <vector>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/text/utf16.h"
#include "server/session/csv/csv_fields.h"

namespace touchstone::session {
namespace {

// Share of a column's whole numbers that are no longer than the last one, from which its length is usual.
constexpr double kUsualLength = 0.05;

constexpr absl::string_view kSeparators = ",;\t|";

// Columns that hold names; all others hold numbers.
bool HoldsNames(absl::string_view column) {
  return column == "object" || column == "file";
}

// "sep=;" as the first line tells some spreadsheets.
std::optional<char> AnnouncedSeparator(absl::string_view line) {
  line = absl::StripAsciiWhitespace(line);
  if (absl::StartsWith(line, "\"") && absl::EndsWith(line, "\"") && line.size() > 2)
    line = line.substr(1, line.size() - 2);
  if (!absl::StartsWithIgnoreCase(line, "sep=")) return std::nullopt;
  line.remove_prefix(4);
  return line.empty() ? '\t' : line[0];  // a tab is white space, stripped above
}

// What parts the header's fields: no column's name has any of the separators.
char SeparatorOf(absl::string_view header) {
  for (const char separator : kSeparators)
    if (absl::StrContains(header, separator)) return separator;
  return ',';
}

// How a number is written, as far as its comma goes.
enum class Notation { kOther, kPoint, kDecimalComma, kCommaOfEitherKind };

Notation NotationOf(absl::string_view field) {
  const std::string number = WithPlainSigns(field);
  absl::string_view digits = number;
  if (!digits.empty() && (digits[0] == '-' || digits[0] == '+')) digits.remove_prefix(1);
  const auto take_digits = [&digits] {
    size_t count = 0;
    while (count < digits.size() && absl::ascii_isdigit(digits[count])) ++count;
    digits.remove_prefix(count);
    return count;
  };
  const bool leading_zero = absl::StartsWith(digits, "0");
  const size_t whole = take_digits();
  if (digits.empty() || (digits[0] != '.' && digits[0] != ',')) return Notation::kOther;
  const bool comma = digits[0] == ',';
  digits.remove_prefix(1);
  const size_t fraction = take_digits();
  const bool exponent = absl::StartsWithIgnoreCase(digits, "e");
  if ((!digits.empty() && !exponent) || whole + fraction == 0)
    // 1,234,567 has commas of thousands.
    return comma && absl::StrContains(digits, ',') ? Notation::kCommaOfEitherKind : Notation::kOther;
  if (!comma) return Notation::kPoint;
  const bool may_be_thousands = fraction == 3 && whole >= 1 && whole <= 3 && !leading_zero && !exponent;
  return may_be_thousands ? Notation::kCommaOfEitherKind : Notation::kDecimalComma;
}

// A place in a file, for messages.
struct CsvPlace {
  int line = 0;
  std::string column, field;
};

class CsvConversion {
 public:
  CsvConversion(absl::string_view text, std::string origin) : text_(text), origin_(std::move(origin)) {}

  absl::StatusOr<std::optional<PlainCsv>> Convert(bool thorough) {
    TOUCHSTONE_RETURN_IF_ERROR(ReadHead());
    TOUCHSTONE_RETURN_IF_ERROR(CheckLastField());
    // Without quotes a comma parts fields and nothing else.
    const bool may_have_decimal_commas = separator_ != ',' || absl::StrContains(text_, '"');
    if (may_have_decimal_commas) TOUCHSTONE_RETURN_IF_ERROR(FindNotation());
    if (!thorough && separator_ == ',' && !decimal_commas_ && skipped_lines_ == 0) return std::nullopt;
    PlainCsv plain;
    plain.skipped_lines = skipped_lines_;
    plain.text = PlainText(thorough);
    return plain;
  }

 private:
  absl::Status ReadHead() {
    absl::string_view rest = text_, line;
    if (!NextLine(&rest, &line)) return absl::OkStatus();
    const std::optional<char> announced = AnnouncedSeparator(line);
    if (announced) {
      skipped_lines_ = 1;
      text_ = rest;
      if (!NextLine(&rest, &line)) line = "";
    }
    separator_ = announced && absl::StrContains(line, *announced) ? *announced : SeparatorOf(line);
    CsvFields fields(separator_);
    // Where the header cannot be cut, the reader says why.
    if (fields.Cut(line).ok()) columns_ = std::vector<std::string>(fields.all().begin(), fields.all().end());
    return absl::OkStatus();
  }

  // Calls `body(fields, line number)` for each row of as many fields as the header has.
  template <typename Body>
  void ForEachRow(const Body& body) const {
    CsvFields fields(separator_);
    absl::string_view rest = text_, line;
    for (int number = skipped_lines_ + 1; NextLine(&rest, &line); ++number)
      if (number > skipped_lines_ + 1 && fields.Cut(line).ok() && fields.all().size() == columns_.size())
        body(fields.all(), number);
  }

  absl::Status FindNotation() {
    CsvPlace point, either, comma;
    ForEachRow([&](const std::vector<absl::string_view>& fields, int number) {
      for (size_t i = 0; i < fields.size(); ++i) {
        if (HoldsNames(columns_[i])) continue;
        const Notation notation = NotationOf(fields[i]);
        CsvPlace* const place = notation == Notation::kPoint               ? &point
                                : notation == Notation::kDecimalComma      ? &comma
                                : notation == Notation::kCommaOfEitherKind ? &either
                                                                           : nullptr;
        if (place != nullptr && place->line == 0) *place = {number, columns_[i], std::string(fields[i])};
      }
    });
    const CsvPlace& first = comma.line > 0 ? comma : either;
    if (first.line == 0) return absl::OkStatus();
    if (point.line > 0)
      return Wrong(first, absl::StrCat("has a comma, but '", Shown(point.field), "' (line ", point.line,
                                       ", column ", point.column,
                                       ") a point; numbers with decimal points and without commas were "
                                       "expected, or all with decimal commas"));
    if (comma.line == 0)
      return Wrong(
          first,
          "has a comma that may be a decimal one or part thousands, as all commas of the file; numbers "
          "with decimal points and without commas were expected");
    decimal_commas_ = true;
    return absl::OkStatus();
  }

  // A file that ends within a line may have lost a part of its last field: the digits show it where other rows have more.
  absl::Status CheckLastField() const {
    if (text_.empty() || text_.back() == '\n' || text_.back() == '\r' || columns_.empty())
      return absl::OkStatus();
    const bool names = HoldsNames(columns_.back());
    CsvPlace last;
    std::vector<std::string> others;
    ForEachRow([&](const std::vector<absl::string_view>& fields, int number) {
      if (last.line > 0) others.push_back(std::move(last.field));
      last = {number, columns_.back(), std::string(fields.back())};
    });
    absl::string_view rest = text_, line;
    int lines = skipped_lines_;
    while (NextLine(&rest, &line)) ++lines;
    if (others.empty() || last.line != lines || !MayBeCut(last.field, others, names)) return absl::OkStatus();
    return Wrong(
        last,
        absl::StrCat("may be cut off: the file ends within this line, and other rows have values like '",
                     Shown(others.back()), "'; write the file again, or end the line if the field is whole"));
  }

  static bool MayBeCut(const std::string& last, const std::vector<std::string>& others, bool names) {
    const auto share = [&others](const auto& holds) {
      return static_cast<double>(std::count_if(others.begin(), others.end(), holds)) /
             static_cast<double>(others.size());
    };
    if (last.empty()) return share([](const std::string& other) { return other.empty(); }) == 0;
    if (names)
      return share([&](const std::string& other) { return other == last; }) == 0 &&
             share([&](const std::string& other) { return absl::StartsWith(other, last); }) > 0;
    const auto point = [](const std::string& field) { return field.find_first_of(".,"); };
    // Digits behind the point; none where there is no point.
    const auto decimals = [&point](const std::string& field) {
      return point(field) == std::string::npos ? size_t{0} : field.size() - point(field) - 1;
    };
    if (point(last) == last.size() - 1 || absl::StrContains("eE+-", last.back()) ||
        absl::EndsWith(last, "e-0"))
      return true;
    if (point(last) != std::string::npos)
      return share([&](const std::string& other) { return decimals(other) > 2 * decimals(last); }) > 0.5;
    if (share([&](const std::string& other) { return point(other) != std::string::npos; }) > 0.5) return true;
    return share([&](const std::string& other) { return other.size() <= last.size(); }) < kUsualLength;
  }

  std::string PlainText(bool thorough) const {
    std::string plain;
    plain.reserve(text_.size() + 64);
    CsvFields fields(separator_);
    absl::string_view rest = text_, line;
    while (NextLine(&rest, &line)) {
      if (!fields.Cut(line).ok()) {
        absl::StrAppend(&plain, line);  // the reader says what is wrong with it
      } else {
        for (size_t i = 0; i < fields.all().size(); ++i)
          absl::StrAppend(&plain, i > 0 ? "," : "", PlainField(fields.all()[i], i, thorough));
      }
      const absl::string_view line_end(line.data() + line.size(), rest.data() - line.data() - line.size());
      absl::StrAppend(&plain, thorough ? "\n" : line_end);
    }
    return plain;
  }

  std::string PlainField(absl::string_view field, size_t column, bool thorough) const {
    if (column >= columns_.size() || HoldsNames(columns_[column])) return QuotedField(std::string(field));
    std::string number = thorough ? WithPlainSigns(field) : std::string(field);
    if (decimal_commas_ && NotationOf(field) >= Notation::kDecimalComma)
      std::replace(number.begin(), number.end(), ',', '.');
    return QuotedField(number);
  }

  absl::Status Wrong(const CsvPlace& place, absl::string_view what) const {
    return absl::InvalidArgumentError(absl::StrCat(origin_, ":", place.line, ": column ", place.column, ": '",
                                                   Shown(place.field), "' ", what));
  }

  absl::string_view text_;  // from the header on
  const std::string origin_;
  int skipped_lines_ = 0;
  char separator_ = ',';
  bool decimal_commas_ = false;
  std::vector<std::string> columns_;
};

}  // namespace

absl::StatusOr<std::optional<PlainCsv>> ConvertToPlainCsv(absl::string_view csv, const std::string& origin,
                                                          bool thorough) {
  std::string utf8;
  const bool is_utf16 = IsUtf16(csv);
  if (is_utf16) {
    absl::StatusOr<std::string> text = Utf8FromUtf16(csv);
    if (!text.ok()) return absl::InvalidArgumentError(absl::StrCat(origin, ": ", text.status().message()));
    csv = utf8 = *std::move(text);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<PlainCsv> plain, CsvConversion(csv, origin).Convert(thorough));
  if (!plain && is_utf16) plain = PlainCsv{std::move(utf8), 0};
  return plain;
}

}  // namespace touchstone::session
