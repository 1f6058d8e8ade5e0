#include "server/session/measurements/measurement_columns.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <map>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/model/model.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {
namespace {

// The columns of a touch's pose, in the order in which files are written. All or none.
struct PoseColumn {
  const char* name;
  ColumnKind kind;
  int axis;
};
constexpr PoseColumn kPoseColumns[] = {
    {"speed_mm_s", ColumnKind::kSpeed, 0},    {"standoff_mm", ColumnKind::kStandoff, 0},
    {"target_x_mm", ColumnKind::kTarget, 0},  {"target_y_mm", ColumnKind::kTarget, 1},
    {"target_z_mm", ColumnKind::kTarget, 2},  {"approach_x", ColumnKind::kApproach, 0},
    {"approach_y", ColumnKind::kApproach, 1}, {"approach_z", ColumnKind::kApproach, 2},
    {"lateral_x", ColumnKind::kLateral, 0},   {"lateral_y", ColumnKind::kLateral, 1},
    {"lateral_z", ColumnKind::kLateral, 2}};

bool IsPose(ColumnKind kind) {
  return kind >= ColumnKind::kSpeed && kind <= ColumnKind::kLateral;
}

// "t_l_us" -> 0, "t_7_us" -> 7; -1: no time column. Letters stand for exactly three fingers.
int FingerOfColumn(const std::string& name) {
  if (name == "t_l_us") return 0;
  if (name == "t_m_us") return 1;
  if (name == "t_r_us") return 2;
  if (!absl::StartsWith(name, "t_") || !absl::EndsWith(name, "_us") || name.size() < 6) return -1;
  const std::string digits = name.substr(2, name.size() - 5);
  int finger = -1;
  const bool plain = digits.find_first_not_of("0123456789") == std::string::npos &&
                     (digits.size() == 1 || digits[0] != '0') && absl::SimpleAtoi(digits, &finger);
  return plain && finger < model::kMaxFingers ? finger : -1;
}

// The column that a name stands for; its index is set later where it is a covariate.
bool ColumnOf(const std::string& name, Column* column) {
  column->name = name;
  for (const PoseColumn& pose : kPoseColumns)
    if (name == pose.name) {
      column->kind = pose.kind;
      column->index = pose.axis;
      return true;
    }
  static const std::pair<const char*, ColumnKind> others[] = {{"touch", ColumnKind::kTouch},
                                                              {"object", ColumnKind::kObject},
                                                              {"session_time_s", ColumnKind::kSessionTime},
                                                              {"round", ColumnKind::kRound},
                                                              {"face", ColumnKind::kFace}};
  for (const auto& [other, kind] : others)
    if (name == other) {
      column->kind = kind;
      return true;
    }
  if (const int finger = FingerOfColumn(name); finger >= 0) {
    column->kind = ColumnKind::kTime;
    column->index = finger;
    return true;
  }
  column->kind = ColumnKind::kCovariate;
  return IsCovariateName(name);
}

std::vector<std::string> KnownNames() {
  std::vector<std::string> names = {"touch", "object"};
  for (const PoseColumn& pose : kPoseColumns) names.push_back(pose.name);
  names.insert(names.end(), {"t_l_us", "t_m_us", "t_r_us", "session_time_s", "round", "face"});
  return names;
}

absl::Status CheckFingers(const std::map<int, std::string>& times, const std::string& place) {
  const bool letters = std::any_of(times.begin(), times.end(),
                                   [](const auto& time) { return absl::ascii_isalpha(time.second[2]); });
  const int fingers = letters ? 3 : times.empty() ? 0 : times.rbegin()->first + 1;
  for (int finger = 0; finger < fingers; ++finger) {
    const auto found = times.find(finger);
    const std::string expected = absl::StrCat("t_", model::FingerName(finger, letters ? 3 : 0), "_us");
    if (found == times.end())
      return absl::InvalidArgumentError(absl::StrCat(
          place, "time columns must be t_l_us,t_m_us,t_r_us or t_0_us,t_1_us,... without a gap; finger ",
          finger, " is missing: a column '", expected, "' was expected"));
    if (found->second != expected)
      return absl::InvalidArgumentError(absl::StrCat(place, "column '", found->second,
                                                     "': letters and numbers of fingers are mixed; '",
                                                     expected, "' was expected"));
  }
  if (letters && times.size() > 3)
    return absl::InvalidArgumentError(absl::StrCat(
        place, "column '", times.rbegin()->second,
        "': letters and numbers of fingers are mixed; with more than three fingers all are numbered"));
  return absl::OkStatus();
}

// A row must say what was touched, how, and when each finger met it.
absl::Status CheckComplete(const Columns& columns, const std::string& place) {
  const auto has = [&](const std::string& name) {
    return std::any_of(columns.all.begin(), columns.all.end(),
                       [&](const Column& column) { return column.name == name; });
  };
  const bool any_pose = std::any_of(columns.all.begin(), columns.all.end(),
                                    [](const Column& column) { return IsPose(column.kind); });
  const auto missing = [&](const std::string& name, const char* why) {
    return absl::InvalidArgumentError(absl::StrCat(place, "column '", name, "' is missing", why));
  };
  if (!has("object")) return missing("object", "; the first line must be the header (touch,object,...)");
  if (!any_pose && columns.fingers > 0) return absl::OkStatus();
  // A set without any time and without any pose is reported as one that lacks its poses.
  if (!has("touch")) return missing("touch", "");
  for (const PoseColumn& pose : kPoseColumns)
    if (!has(pose.name))
      return missing(pose.name, any_pose ? ""
                                         : "; so are times: a set has either poses, or object and t_*_us, "
                                           "or both");
  return absl::OkStatus();
}

}  // namespace

bool IsCovariateName(absl::string_view name) {
  return absl::StartsWith(name, "cov_") && name.size() > 4 &&
         std::all_of(name.begin(), name.end(), [](char c) { return absl::ascii_isalnum(c) || c == '_'; });
}

absl::StatusOr<Columns> ReadColumns(const std::vector<std::string>& names, const std::string& origin) {
  Columns columns;
  std::map<std::string, size_t> seen;
  std::map<int, std::string> times;
  const std::string line = absl::StrCat(origin, ":1: ");
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    const std::string place = absl::StrCat(line, "column ", i + 1, " '", Shown(name), "' ");
    if (const auto [at, first] = seen.emplace(name, i + 1); !first)
      return absl::InvalidArgumentError(
          absl::StrCat(place, "stands twice in the header, first as column ", at->second));
    Column column;
    if (!ColumnOf(name, &column)) {
      if (name.empty())
        return absl::InvalidArgumentError(
            absl::StrCat(place, "has no name; is there a comma too many in the header?"));
      if (absl::StartsWith(name, "cov_"))
        return absl::InvalidArgumentError(absl::StrCat(
            place, "is no name of a covariate: letters, digits and '_' were expected after cov_"));
      return absl::InvalidArgumentError(absl::StrCat(place, "is no column of a measurement file",
                                                     DidYouMean(name, KnownNames()),
                                                     " (further numbers have names that begin with cov_)"));
    }
    switch (column.kind) {
      case ColumnKind::kTime:
        if (!times.emplace(column.index, name).second)
          return absl::InvalidArgumentError(
              absl::StrCat(place, "is a second column for the same finger as '", times[column.index], "'"));
        break;
      case ColumnKind::kCovariate:
        column.index = static_cast<int>(columns.covariates.size());
        columns.covariates.push_back(name);
        break;
      case ColumnKind::kTouch:
        columns.has_touch = true;
        break;
      case ColumnKind::kSessionTime:
        columns.has_session_time = true;
        break;
      case ColumnKind::kRound:
        columns.has_round = true;
        break;
      case ColumnKind::kFace:
        columns.has_face = true;
        break;
      default:
        columns.has_poses = columns.has_poses || IsPose(column.kind);
    }
    columns.all.push_back(std::move(column));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckFingers(times, line));
  columns.fingers = static_cast<int>(times.size());
  TOUCHSTONE_RETURN_IF_ERROR(CheckComplete(columns, line));
  return columns;
}

}  // namespace touchstone::session
