#include "client/source/measurement_csv.h"

#include <absl/strings/ascii.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "client/source/lab_units.h"
#include "server/base/status.h"
#include "server/base/text.h"

namespace touchstone::client {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kMostFingersInFile = 16;

std::string Millimetres(double metres) {
  return ShortestNumber(LabNumber(Unit::kMillimetre, metres));
}

void AppendVector(const v1::Vector3& v, std::string* row) {
  absl::StrAppend(row, ",", ShortestNumber(v.x()), ",", ShortestNumber(v.y()), ",", ShortestNumber(v.z()));
}

// The columns that every row must have, in the order in which we write them.
const std::vector<std::string>& RequiredColumns() {
  static const std::vector<std::string> names = {
      "touch",      "object",     "speed_mm_s", "standoff_mm", "target_x_mm", "target_y_mm", "target_z_mm",
      "approach_x", "approach_y", "approach_z", "lateral_x",   "lateral_y",   "lateral_z"};
  return names;
}

// "t_l_us" -> 0, "t_m_us" -> 1, "t_r_us" -> 2, "t_7_us" -> 7; -1: no time column.
int FingerOfColumn(const std::string& name) {
  if (name == "t_l_us") return 0;
  if (name == "t_m_us") return 1;
  if (name == "t_r_us") return 2;
  int finger = -1;
  if (name.size() > 5 && name.rfind("t_", 0) == 0 && name.compare(name.size() - 3, 3, "_us") == 0 &&
      absl::SimpleAtoi(name.substr(2, name.size() - 5), &finger) && finger >= 0 &&
      finger < kMostFingersInFile)
    return finger;
  return -1;
}

// Where each column of a file stands, checked once.
struct Layout {
  std::map<std::string, size_t> required;
  std::vector<size_t> times;  // by finger
  std::map<std::string, size_t> covariates;
  int session_time = -1;
  std::vector<std::string> names;
};

absl::StatusOr<Layout> ReadHeader(const std::string& line, const std::string& origin) {
  Layout layout;
  layout.names = absl::StrSplit(line, ',');
  std::map<int, size_t> times;
  std::set<std::string> seen;
  for (size_t i = 0; i < layout.names.size(); ++i) {
    std::string& name = layout.names[i];
    name = std::string(absl::StripAsciiWhitespace(name));
    const std::string place = absl::StrCat(origin, ":1: column ", i + 1, " ");
    if (!seen.insert(name).second)
      return absl::InvalidArgumentError(absl::StrCat(place, "'", name, "' stands twice in the header"));
    const auto& required = RequiredColumns();
    if (std::find(required.begin(), required.end(), name) != required.end()) {
      layout.required[name] = i;
    } else if (FingerOfColumn(name) >= 0) {
      if (!times.emplace(FingerOfColumn(name), i).second)
        return absl::InvalidArgumentError(
            absl::StrCat(place, "'", name, "': a second column for the same finger"));
    } else if (name.rfind("cov_", 0) == 0 && name.size() > 4) {
      layout.covariates[name] = i;
    } else if (name == "session_time_s") {
      layout.session_time = static_cast<int>(i);
    } else if (name != "round" && name != "face") {
      std::vector<std::string> known = required;
      known.insert(known.end(), {"session_time_s", "round", "face", "t_l_us", "t_m_us", "t_r_us"});
      return absl::InvalidArgumentError(absl::StrCat(place, "'", name, "' is no column of a measurement file",
                                                     DidYouMean(name, known),
                                                     " Further numbers have names that begin with cov_"));
    }
  }
  for (const std::string& name : RequiredColumns())
    if (layout.required.count(name) == 0)
      return absl::InvalidArgumentError(absl::StrCat(origin, ":1: column '", name, "' is missing"));
  for (const auto& [finger, column] : times) {
    if (finger != static_cast<int>(layout.times.size()))
      return absl::InvalidArgumentError(absl::StrCat(
          origin, ":1: time columns must be t_l_us,t_m_us,t_r_us or t_0_us,t_1_us,... without a gap; ",
          "finger ", layout.times.size(), " is missing"));
    layout.times.push_back(column);
  }
  return layout;
}

}  // namespace

std::string FingerName(int finger, int fingers) {
  return fingers == 3 ? std::string(1, "lmr"[finger]) : std::to_string(finger);
}

std::string TimeColumnName(int finger, int fingers) {
  return absl::StrCat("t_", FingerName(finger, fingers), "_us");
}

std::string MeasurementHeader(int fingers, bool session_time, const std::vector<std::string>& covariates) {
  std::string line;
  for (const std::string& name : RequiredColumns()) absl::StrAppend(&line, line.empty() ? "" : ",", name);
  for (int i = 0; i < fingers; ++i) absl::StrAppend(&line, ",", TimeColumnName(i, fingers));
  if (session_time) absl::StrAppend(&line, ",session_time_s");
  for (const std::string& name : covariates) absl::StrAppend(&line, ",", name);
  return line + "\n";
}

std::string MeasurementRow(const MeasuredTouch& touch, bool session_time,
                           const std::vector<std::string>& covariates) {
  const v1::CommandedTouch& c = touch.commanded;
  std::string row = absl::StrCat(touch.touch, ",", touch.object, ",",
                                 ShortestNumber(LabNumber(Unit::kMillimetrePerSecond, c.speed_m_s())), ",",
                                 Millimetres(c.standoff_m()), ",", Millimetres(c.target_m().x()), ",",
                                 Millimetres(c.target_m().y()), ",", Millimetres(c.target_m().z()));
  AppendVector(c.approach(), &row);
  AppendVector(c.lateral(), &row);
  for (const double time_s : touch.time_s)
    absl::StrAppend(&row, ",",
                    std::isnan(time_s) ? "" : ShortestNumber(LabNumber(Unit::kMicrosecond, time_s)));
  if (session_time) absl::StrAppend(&row, ",", ShortestNumber(c.session_time_s()));
  for (const std::string& name : covariates) {
    const auto found = c.covariates().find(name);
    absl::StrAppend(&row, ",", found == c.covariates().end() ? "" : ShortestNumber(found->second));
  }
  return row + "\n";
}

std::string FormatMeasurements(const std::vector<MeasuredTouch>& touches) {
  bool session_time = false;
  std::set<std::string> names;
  for (const MeasuredTouch& touch : touches) {
    session_time = session_time || touch.commanded.has_session_time_s();
    for (const auto& [name, value] : touch.commanded.covariates()) names.insert(name);
  }
  const std::vector<std::string> covariates(names.begin(), names.end());
  const int fingers = touches.empty() ? 0 : static_cast<int>(touches[0].time_s.size());
  std::string text = MeasurementHeader(fingers, session_time, covariates);
  for (const MeasuredTouch& touch : touches) text += MeasurementRow(touch, session_time, covariates);
  return text;
}

absl::StatusOr<std::vector<MeasuredTouch>> ParseMeasurements(const std::string& text,
                                                             const std::string& origin) {
  std::vector<std::string> lines = absl::StrSplit(text, '\n');
  // A file from a spreadsheet may begin with a byte-order mark.
  if (lines[0].rfind("\xEF\xBB\xBF", 0) == 0) lines[0] = lines[0].substr(3);
  if (absl::StripAsciiWhitespace(lines[0]).empty())
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ":1: a header line was expected (touch,object,...)"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Layout layout, ReadHeader(lines[0], origin));

  std::vector<MeasuredTouch> touches;
  for (size_t n = 1; n < lines.size(); ++n) {
    if (absl::StripAsciiWhitespace(lines[n]).empty()) continue;
    const std::vector<std::string> cells = absl::StrSplit(lines[n], ',');
    const std::string line_place = absl::StrCat(origin, ":", n + 1, ": ");
    if (cells.size() != layout.names.size())
      return absl::InvalidArgumentError(
          absl::StrCat(line_place, "has ", cells.size(), " columns, the header has ", layout.names.size()));
    absl::Status failed;
    // The number in a column; NaN where it is empty and may be.
    const auto number = [&](size_t column, bool may_be_empty) {
      const absl::string_view cell = absl::StripAsciiWhitespace(cells[column]);
      if (cell.empty() && may_be_empty) return kNan;
      const absl::StatusOr<double> value = ParseNumber(cell);
      if (value.ok()) return *value;
      if (failed.ok())
        failed = absl::InvalidArgumentError(
            absl::StrCat(line_place, "column ", layout.names[column], ": ",
                         cell.empty() ? "is empty; a number was expected" : value.status().message()));
      return kNan;
    };
    const auto required = [&](const std::string& name) { return number(layout.required.at(name), false); };
    const auto millimetres = [&](const std::string& name) { return ToSi(Unit::kMillimetre, required(name)); };

    MeasuredTouch touch;
    const double touch_number = required("touch");
    if (failed.ok() &&
        !(touch_number >= 0 && touch_number < 9e15 && touch_number == std::floor(touch_number)))
      failed = absl::InvalidArgumentError(absl::StrCat(
          line_place, "column touch: ", ShortestNumber(touch_number), " is not a whole number from 0 on"));
    if (failed.ok()) touch.touch = static_cast<uint64_t>(touch_number);
    touch.object = std::string(absl::StripAsciiWhitespace(cells[layout.required.at("object")]));
    if (touch.object.empty() && failed.ok())
      failed = absl::InvalidArgumentError(
          absl::StrCat(line_place, "column object: is empty; a name was expected"));
    v1::CommandedTouch& c = touch.commanded;
    c.set_speed_m_s(ToSi(Unit::kMillimetrePerSecond, required("speed_mm_s")));
    c.set_standoff_m(millimetres("standoff_mm"));
    c.mutable_target_m()->set_x(millimetres("target_x_mm"));
    c.mutable_target_m()->set_y(millimetres("target_y_mm"));
    c.mutable_target_m()->set_z(millimetres("target_z_mm"));
    c.mutable_approach()->set_x(required("approach_x"));
    c.mutable_approach()->set_y(required("approach_y"));
    c.mutable_approach()->set_z(required("approach_z"));
    c.mutable_lateral()->set_x(required("lateral_x"));
    c.mutable_lateral()->set_y(required("lateral_y"));
    c.mutable_lateral()->set_z(required("lateral_z"));
    for (const size_t column : layout.times)
      touch.time_s.push_back(ToSi(Unit::kMicrosecond, number(column, true)));
    if (layout.session_time >= 0) c.set_session_time_s(number(layout.session_time, false));
    for (const auto& [name, column] : layout.covariates) {
      const double value = number(column, true);
      if (!std::isnan(value)) (*c.mutable_covariates())[name] = value;
    }
    TOUCHSTONE_RETURN_IF_ERROR(failed);
    touches.push_back(std::move(touch));
  }
  if (touches.empty()) return absl::InvalidArgumentError(absl::StrCat(origin, ": has a header but no touch"));
  return touches;
}

}  // namespace touchstone::client
