#include "server/session/measurements/measurement_set.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/over_limit.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"
#include "server/base/units.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/measurements/measurement_checks.h"
#include "server/session/measurements/measurement_columns.h"

namespace touchstone::session {
namespace {

constexpr size_t kMaxReserved = 1 << 20;
constexpr double kLargestCount = 9e15;  // whole numbers up to here are exact as doubles

// Reads rows into the columns of a set. One object a file.
class RowReader {
 public:
  RowReader(const Columns& columns, const MeasurementLimits& limits, MeasurementSet* set)
      : columns_(columns), limits_(limits), set_(*set) {
    covariates_.reserve(columns.covariates.size());
    for (const std::string& name : columns.covariates) covariates_.push_back(&set_.covariates[name]);
  }

  absl::Status Read(const std::vector<absl::string_view>& fields, int line) {
    line_ = line;
    fields_ = &fields;
    if (fields.size() != columns_.all.size())
      return Wrong(absl::StrCat("has ", fields.size(), " columns, the header has ", columns_.all.size()));
    set_.line.push_back(line);
    if (!columns_.has_touch) set_.touch.push_back(set_.touch.size());
    if (columns_.has_poses) {
      set_.target_m.emplace_back();
      set_.approach.emplace_back();
      set_.lateral.emplace_back();
    }
    if (!columns_.has_session_time) set_.session_time_s.push_back(0);
    const size_t row = set_.line.size() - 1;
    if (columns_.fingers > 0) set_.time_s.resize((row + 1) * columns_.fingers, kNaN);
    for (size_t i = 0; i < fields.size(); ++i) TOUCHSTONE_RETURN_IF_ERROR(ReadField(i, row));
    return columns_.has_poses ? MakeExact(row) : absl::OkStatus();
  }

 private:
  absl::Status ReadField(size_t i, size_t row) {
    const Column& column = columns_.all[i];
    const absl::string_view field = (*fields_)[i];
    const auto number = [&] { return Number(i); };
    switch (column.kind) {
      case ColumnKind::kTouch: {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double value,
                                    Whole(i, 0, kLargestCount, "a whole number from 0 on"));
        set_.touch.push_back(static_cast<uint64_t>(value));
        break;
      }
      case ColumnKind::kObject:
        return ReadObject(i, field);
      case ColumnKind::kSpeed: {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double value, number());
        set_.speed_m_s.push_back(ToSi(Unit::kMillimetrePerSecond, value));
        if (!(set_.speed_m_s.back() > 0 && set_.speed_m_s.back() <= kMaxSpeedMS))
          return OutOfRange(i, "a speed above 0 and at most 10000 mm/s was expected");
        break;
      }
      case ColumnKind::kStandoff: {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double value, number());
        set_.standoff_m.push_back(ToSi(Unit::kMillimetre, value));
        if (!(set_.standoff_m.back() >= 0 && set_.standoff_m.back() <= kMaxStandoffM))
          return OutOfRange(i, "a distance from 0 to 10000 mm was expected");
        break;
      }
      case ColumnKind::kTarget: {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double value, number());
        set_.target_m[row][column.index] = ToSi(Unit::kMillimetre, value);
        if (!(std::abs(set_.target_m[row][column.index]) <= kMaxTargetM))
          return OutOfRange(i, "a coordinate within 100000 mm of the object's origin was expected");
        break;
      }
      case ColumnKind::kApproach: {
        TOUCHSTONE_ASSIGN_OR_RETURN(set_.approach[row][column.index], number());
        break;
      }
      case ColumnKind::kLateral: {
        TOUCHSTONE_ASSIGN_OR_RETURN(set_.lateral[row][column.index], number());
        break;
      }
      case ColumnKind::kTime: {
        if (field.empty()) break;  // the finger reported nothing
        TOUCHSTONE_ASSIGN_OR_RETURN(const double value, number());
        if (value < 0 || value > limits_.max_time_us)
          return OutOfRange(i,
                            absl::StrCat("a time from 0 to ", limits_.max_time_us,
                                         " us was expected, or nothing where the finger reported nothing"));
        set_.time_s[row * columns_.fingers + column.index] = ToSi(Unit::kMicrosecond, value);
        break;
      }
      case ColumnKind::kSessionTime: {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double value, number());
        if (!(value >= 0 && value <= kMaxSessionTimeS))
          return OutOfRange(i, "seconds from 0 to 1e9 since the session began were expected");
        set_.session_time_s.push_back(value);
        break;
      }
      case ColumnKind::kRound:
      case ColumnKind::kFace: {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double value, Whole(i, 0, INT32_MAX, "a whole number from 0 on"));
        (column.kind == ColumnKind::kRound ? set_.round : set_.face).push_back(static_cast<int>(value));
        break;
      }
      case ColumnKind::kCovariate: {
        double value = kNaN;
        if (!field.empty()) {
          TOUCHSTONE_ASSIGN_OR_RETURN(value, number());
        }
        covariates_[column.index]->push_back(value);
        break;
      }
    }
    return absl::OkStatus();
  }

  absl::Status ReadObject(size_t i, absl::string_view name) {
    // Rows of one object mostly follow each other.
    if (set_.object.empty() || set_.objects[set_.object.back()] != name) {
      if (name.empty()) return WrongField(i, "is empty; a name was expected");
      if (name.size() > kMaxObjectNameBytes || !IsText(name))
        return WrongField(i, absl::StrCat("'", Shown(name), "' is no name: at most ", kMaxObjectNameBytes,
                                          " bytes of UTF-8 without control characters were expected"));
      if (set_.objects.size() >= limits_.max_objects && objects_.count(name) == 0)
        return OverLimit(absl::StrCat(set_.origin, ":", line_, ": objects:"), set_.objects.size() + 1,
                         "max_session_objects", limits_.max_objects);
      const auto [found, is_new] = objects_.try_emplace(std::string(name), static_cast<int>(objects_.size()));
      if (is_new) set_.objects.emplace_back(name);
      set_.object.push_back(found->second);
    } else {
      set_.object.push_back(set_.object.back());
    }
    return absl::OkStatus();
  }

  absl::StatusOr<double> Number(size_t i) const {
    const absl::string_view field = (*fields_)[i];
    const absl::StatusOr<double> read = FieldNumber(field);
    if (!read.ok()) return WrongField(i, std::string(read.status().message()));
    const double value = *read;
    if (!std::isfinite(value))
      return WrongField(i, absl::StrCat("'", Shown(field), "' is not a finite number",
                                        columns_.all[i].kind == ColumnKind::kTime
                                            ? "; where a finger reported nothing, an empty field was expected"
                                            : ""));
    return value;
  }

  absl::StatusOr<double> Whole(size_t i, double lowest, double highest, const char* expected) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const double value, Number(i));
    if (value >= lowest && value <= highest && value == std::floor(value)) return value;
    return WrongField(i, absl::StrCat(Shown((*fields_)[i]), " is not ", expected));
  }

  absl::Status MakeExact(size_t row) {
    Eigen::Vector3d& approach = set_.approach[row];
    Eigen::Vector3d& lateral = set_.lateral[row];
    const auto not_unit = [&](const Eigen::Vector3d& vector, const char* name) {
      return Wrong(absl::StrCat("columns ", name, "_x, ", name, "_y, ", name, "_z: ", VectorText(vector),
                                " has length ", ShortestNumber(vector.norm()),
                                "; a unit vector was expected (within 0.001)"));
    };
    switch (MakeOrthonormal(&approach, &lateral)) {
      case VectorFlaw::kNone:
        break;
      case VectorFlaw::kApproachLength:
        return not_unit(approach, "approach");
      case VectorFlaw::kLateralLength:
        return not_unit(lateral, "lateral");
      case VectorFlaw::kNotPerpendicular:
        return Wrong(absl::StrCat("columns lateral_x, lateral_y, lateral_z: ", VectorText(lateral),
                                  " is not perpendicular to the approach ", VectorText(approach),
                                  ": their dot product is ", ShortestNumber(approach.dot(lateral)),
                                  "; 0 was expected (within 0.001)"));
    }
    return absl::OkStatus();
  }

  absl::Status OutOfRange(size_t i, const std::string& expected) const {
    return WrongField(i, absl::StrCat(Shown((*fields_)[i]), " is out of range; ", expected));
  }
  absl::Status WrongField(size_t i, const std::string& what) const {
    return Wrong(
        absl::StrCat("column ", columns_.all[i].name, ": ", what, " (field ", i + 1, " of the row)"));
  }
  absl::Status Wrong(const std::string& what) const {
    return absl::InvalidArgumentError(absl::StrCat(set_.origin, ":", line_, ": ", what));
  }

  const Columns& columns_;
  const MeasurementLimits& limits_;
  MeasurementSet& set_;
  std::vector<std::vector<double>*> covariates_;
  absl::flat_hash_map<std::string, int> objects_;
  const std::vector<absl::string_view>* fields_ = nullptr;
  int line_ = 0;
};

void Reserve(size_t rows, const Columns& columns, MeasurementSet* set) {
  set->line.reserve(rows);
  set->touch.reserve(rows);
  set->object.reserve(rows);
  set->session_time_s.reserve(rows);
  set->time_s.reserve(rows * columns.fingers);
  if (!columns.has_poses) return;
  set->target_m.reserve(rows);
  set->approach.reserve(rows);
  set->lateral.reserve(rows);
  set->standoff_m.reserve(rows);
  set->speed_m_s.reserve(rows);
}

}  // namespace

absl::StatusOr<MeasurementSet> ParseMeasurementSet(absl::string_view csv, const std::string& origin,
                                                   const MeasurementLimits& limits) {
  MeasurementSet set;
  set.origin = origin;
  const auto wrong = [&](int line, absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ":", line, ": ", what));
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(CsvLines lines, CsvLines::Open(csv, origin));
  CsvFields fields;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const std::vector<std::string> names,
      ReadCsvHeader(origin, "touch,object,...", MeasurementLimits().max_columns, &lines, &fields));
  if (names.size() > limits.max_columns)
    return OverLimit(absl::StrCat(origin, ":1: columns:"), names.size(), "max_session_columns",
                     limits.max_columns);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Columns columns, ReadColumns(names, origin));
  set.fingers = columns.fingers;
  set.has_poses = columns.has_poses;
  set.has_session_time = columns.has_session_time;
  const size_t rows = lines.left();
  if (rows >= std::numeric_limits<int>::max())
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ": has ", rows, " lines; at most 2^31 - 2 are read"));
  // A file of empty lines has no row: what is set aside is what its bytes could hold, and at first no more than a million.
  Reserve(std::min({rows, csv.size() / names.size() + 1, limits.max_touches, kMaxReserved}), columns, &set);

  RowReader reader(columns, limits, &set);
  for (absl::string_view row; lines.Next(&row);) {
    if (absl::StripAsciiWhitespace(row).empty()) continue;
    if (absl::Status status = fields.Cut(row); !status.ok()) return wrong(lines.number(), status.message());
    if (set.line.size() >= limits.max_touches)
      return OverLimit(absl::StrCat(origin, ":", lines.number(), ": touches:"), set.line.size() + 1,
                       "max_session_touches", limits.max_touches);
    TOUCHSTONE_RETURN_IF_ERROR(reader.Read(fields.all(), lines.number()));
  }
  if (set.size() == 0)
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ":2: the file has a header but no touch; rows were expected"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouchNumbers(set));
  return set;
}

absl::StatusOr<MeasurementSet> ReadMeasurementSet(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  return ParseMeasurementSet(text, path);
}

}  // namespace touchstone::session
