#include "server/session/measurements/measurement_csv.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <set>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/model/parameter_values.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {
namespace {

std::string Millimetres(double metres) {
  return FileNumber(Unit::kMillimetre, metres);
}

void AppendVector(const v1::Vector3& v, std::string* row) {
  absl::StrAppend(row, ",", ShortestNumber(v.x()), ",", ShortestNumber(v.y()), ",", ShortestNumber(v.z()));
}

// The columns that every row has, in the order in which we write them.
const std::vector<std::string>& RequiredColumns() {
  static const std::vector<std::string> names = {
      "touch",      "object",     "speed_mm_s", "standoff_mm", "target_x_mm", "target_y_mm", "target_z_mm",
      "approach_x", "approach_y", "approach_z", "lateral_x",   "lateral_y",   "lateral_z"};
  return names;
}

v1::Vector3 VectorOf(const Eigen::Vector3d& v) {
  v1::Vector3 vector;
  vector.set_x(v.x());
  vector.set_y(v.y());
  vector.set_z(v.z());
  return vector;
}

}  // namespace

std::string TimeColumnName(int finger, int fingers) {
  return absl::StrCat("t_", model::FingerName(finger, fingers), "_us");
}

std::string MeasurementHeader(int fingers, const MeasurementColumns& columns) {
  std::string line;
  for (const std::string& name : RequiredColumns()) absl::StrAppend(&line, line.empty() ? "" : ",", name);
  for (int i = 0; i < fingers; ++i) absl::StrAppend(&line, ",", TimeColumnName(i, fingers));
  if (columns.session_time) absl::StrAppend(&line, ",session_time_s");
  if (columns.round) absl::StrAppend(&line, ",round");
  if (columns.face) absl::StrAppend(&line, ",face");
  for (const std::string& name : columns.covariates) absl::StrAppend(&line, ",", name);
  return line + "\n";
}

std::string MeasurementRow(const MeasuredTouch& touch, const MeasurementColumns& columns) {
  const v1::CommandedTouch& c = touch.commanded;
  std::string row = absl::StrCat(touch.touch, ",", QuotedField(touch.object), ",",
                                 FileNumber(Unit::kMillimetrePerSecond, c.speed_m_s()), ",",
                                 Millimetres(c.standoff_m()), ",", Millimetres(c.target_m().x()), ",",
                                 Millimetres(c.target_m().y()), ",", Millimetres(c.target_m().z()));
  AppendVector(c.approach(), &row);
  AppendVector(c.lateral(), &row);
  for (const double time_s : touch.time_s)
    absl::StrAppend(&row, ",", std::isnan(time_s) ? "" : FileNumber(Unit::kMicrosecond, time_s));
  if (columns.session_time) absl::StrAppend(&row, ",", ShortestNumber(c.session_time_s()));
  if (columns.round) absl::StrAppend(&row, ",", touch.round.value_or(0));
  if (columns.face) absl::StrAppend(&row, ",", touch.face.value_or(0));
  for (const std::string& name : columns.covariates) {
    const auto found = c.covariates().find(name);
    absl::StrAppend(&row, ",", found == c.covariates().end() ? "" : ShortestNumber(found->second));
  }
  return row + "\n";
}

MeasurementColumns OptionalColumnsOf(const std::vector<MeasuredTouch>& touches) {
  MeasurementColumns columns;
  columns.round = columns.face = !touches.empty();
  std::set<std::string> names;
  for (const MeasuredTouch& touch : touches) {
    columns.session_time = columns.session_time || touch.commanded.has_session_time_s();
    columns.round = columns.round && touch.round;
    columns.face = columns.face && touch.face;
    for (const auto& [name, value] : touch.commanded.covariates()) names.insert(name);
  }
  columns.covariates.assign(names.begin(), names.end());
  return columns;
}

std::string FormatMeasurements(const std::vector<MeasuredTouch>& touches) {
  const MeasurementColumns columns = OptionalColumnsOf(touches);
  const int fingers = touches.empty() ? 0 : static_cast<int>(touches[0].time_s.size());
  std::string text = MeasurementHeader(fingers, columns);
  for (const MeasuredTouch& touch : touches) text += MeasurementRow(touch, columns);
  return text;
}

absl::StatusOr<std::vector<MeasuredTouch>> ParseMeasurements(const std::string& text,
                                                             const std::string& origin) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const MeasurementSet set, ParseMeasurementSet(text, origin));
  if (!set.has_poses)
    return absl::InvalidArgumentError(absl::StrCat(
        origin, ":1: column 'speed_mm_s' is missing, and so are the poses; what is touched needs them"));
  std::vector<MeasuredTouch> touches(set.size());
  for (int row = 0; row < set.size(); ++row) {
    MeasuredTouch& touch = touches[row];
    touch.touch = set.touch[row];
    touch.object = set.objects[set.object[row]];
    v1::CommandedTouch& c = touch.commanded;
    c.set_speed_m_s(set.speed_m_s[row]);
    c.set_standoff_m(set.standoff_m[row]);
    *c.mutable_target_m() = VectorOf(set.target_m[row]);
    *c.mutable_approach() = VectorOf(set.approach[row]);
    *c.mutable_lateral() = VectorOf(set.lateral[row]);
    if (set.has_session_time) c.set_session_time_s(set.session_time_s[row]);
    for (const auto& [name, values] : set.covariates)
      if (!std::isnan(values[row])) (*c.mutable_covariates())[name] = values[row];
    if (!set.round.empty()) touch.round = set.round[row];
    if (!set.face.empty()) touch.face = set.face[row];
    for (int finger = 0; finger < set.fingers; ++finger) touch.time_s.push_back(set.TimeS(row, finger));
  }
  return touches;
}

}  // namespace touchstone::session
