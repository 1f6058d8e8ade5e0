#include "server/session/measurements/measurement_fix.h"

#include <absl/container/flat_hash_set.h>
#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/model/finger_name.h"
#include "server/session/csv/fix_text.h"

namespace touchstone::session {
namespace {

absl::Status Refused(const MeasurementSet& set, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(set.origin, ": ", what));
}

absl::Status CheckObject(const MeasurementSet& set, const std::string& name) {
  if (std::find(set.objects.begin(), set.objects.end(), name) != set.objects.end()) return absl::OkStatus();
  return Refused(set, absl::StrCat("has no object '", name, "'", DidYouMean(name, set.objects)));
}

absl::Status CheckFix(const MeasurementFix& fix, const MeasurementSet& set) {
  const bool moves = fix.axes || fix.reverse_approach || fix.reverse_lateral || !fix.move_objects_m.empty() ||
                     fix.scale_targets != 1 || fix.scale_standoff != 1 || fix.scale_speed != 1;
  if (moves && !set.has_poses) return Refused(set, "has no poses, so none can be fixed");
  for (const double factor : {fix.scale_times, fix.scale_targets, fix.scale_standoff, fix.scale_speed})
    if (!(factor > 0 && std::isfinite(factor)))
      return Refused(set, absl::StrCat("a factor above 0 was expected, not ", ShortestNumber(factor)));
  std::vector<int> sorted = fix.finger_order;
  std::sort(sorted.begin(), sorted.end());
  std::vector<int> all(set.fingers);
  std::iota(all.begin(), all.end(), 0);
  if (!sorted.empty() && sorted != all)
    return Refused(set, absl::StrCat("has ", set.fingers, " fingers; each was expected once"));
  for (const auto& [from, to] : fix.rename_objects) {
    TOUCHSTONE_RETURN_IF_ERROR(CheckObject(set, from));
    if (to.empty()) return Refused(set, "an object needs a name");
  }
  for (const auto& [name, offset_m] : fix.move_objects_m) TOUCHSTONE_RETURN_IF_ERROR(CheckObject(set, name));
  if (std::abs(fix.shift_rows) >= set.size())
    return Refused(set,
                   absl::StrCat("has ", set.size(), " rows; they cannot be shifted by ", fix.shift_rows));
  return absl::OkStatus();
}

// The rows that do not repeat an earlier one. Numbers are compared bit for bit, empty times with empty times.
std::vector<int> RowsWithoutDuplicates(const MeasurementSet& set) {
  absl::flat_hash_set<std::string> seen;
  std::vector<int> kept;
  for (int row = 0; row < set.size(); ++row) {
    std::string key(reinterpret_cast<const char*>(&set.object[row]), sizeof(int));
    const auto add = [&key](const double* values, int count) {
      key.append(reinterpret_cast<const char*>(values), count * sizeof(double));
    };
    if (set.has_poses) {
      for (const auto* column : {&set.target_m, &set.approach, &set.lateral}) add((*column)[row].data(), 3);
      add(&set.standoff_m[row], 1), add(&set.speed_m_s[row], 1);
    }
    add(&set.time_s[static_cast<size_t>(row) * set.fingers], set.fingers);
    if (seen.insert(key).second) kept.push_back(row);
  }
  return kept;
}

std::vector<int> RowsThatAreNotStale(const MeasurementSet& set) {
  std::vector<int> kept;
  for (int row = 0; row < set.size(); ++row)
    if (!RepeatsRow(set, row, 1)) kept.push_back(row);
  return kept;
}

template <typename T>
void Keep(const std::vector<int>& rows, int width, std::vector<T>* column) {
  if (column->empty()) return;
  std::vector<T> kept;
  kept.reserve(rows.size() * width);
  for (const int row : rows)
    for (int i = 0; i < width; ++i) kept.push_back((*column)[static_cast<size_t>(row) * width + i]);
  *column = std::move(kept);
}

void KeepRows(const std::vector<int>& rows, MeasurementSet* set) {
  Keep(rows, 1, &set->touch), Keep(rows, 1, &set->object);
  Keep(rows, 1, &set->target_m), Keep(rows, 1, &set->approach), Keep(rows, 1, &set->lateral);
  Keep(rows, 1, &set->standoff_m), Keep(rows, 1, &set->speed_m_s), Keep(rows, 1, &set->session_time_s);
  Keep(rows, 1, &set->round), Keep(rows, 1, &set->face), Keep(rows, 1, &set->line);
  for (auto& [name, values] : set->covariates) Keep(rows, 1, &values);
  if (set->fingers > 0) Keep(rows, set->fingers, &set->time_s);
}

// The times move down by `shift` rows; returns the rows that have times then.
std::vector<int> ShiftTimes(int shift, MeasurementSet* set) {
  const std::vector<double> old_s = set->time_s;
  std::vector<int> kept;
  for (int row = 0; row < set->size(); ++row) {
    const int from = row - shift;
    if (from < 0 || from >= set->size()) continue;
    std::copy_n(&old_s[static_cast<size_t>(from) * set->fingers], set->fingers,
                &set->time_s[static_cast<size_t>(row) * set->fingers]);
    kept.push_back(row);
  }
  return kept;
}

void RenameObjects(const std::vector<std::pair<std::string, std::string>>& renames, MeasurementSet* set) {
  std::vector<std::string> names = set->objects;
  for (const auto& [from, to] : renames)
    for (size_t o = 0; o < names.size(); ++o)
      if (set->objects[o] == from) names[o] = to;
  // Two old names may have become one.
  std::vector<std::string> objects;
  std::vector<int> index(names.size());
  for (size_t o = 0; o < names.size(); ++o) {
    const auto found = std::find(objects.begin(), objects.end(), names[o]);
    index[o] = static_cast<int>(found - objects.begin());
    if (found == objects.end()) objects.push_back(names[o]);
  }
  for (int& object : set->object) object = index[object];
  set->objects = std::move(objects);
}

void OrderFingers(const std::vector<int>& order, MeasurementSet* set) {
  const std::vector<double> old_s = set->time_s;
  for (size_t row = 0; row < set->object.size(); ++row)
    for (int i = 0; i < set->fingers; ++i)
      set->time_s[row * set->fingers + order[i]] = old_s[row * set->fingers + i];
}

void MovePoses(const MeasurementFix& fix, MeasurementSet* set) {
  std::vector<Eigen::Vector3d> offset_m(set->objects.size(), Eigen::Vector3d::Zero());
  for (const auto& [name, moved_m] : fix.move_objects_m)
    for (size_t o = 0; o < set->objects.size(); ++o)
      if (set->objects[o] == name) offset_m[o] += moved_m;
  for (int row = 0; row < set->size(); ++row) {
    Eigen::Vector3d &target = set->target_m[row], &approach = set->approach[row],
                    &lateral = set->lateral[row];
    if (fix.scale_targets != 1) target *= fix.scale_targets;
    if (fix.scale_standoff != 1) set->standoff_m[row] *= fix.scale_standoff;
    if (fix.scale_speed != 1) set->speed_m_s[row] *= fix.scale_speed;
    if (fix.axes)
      for (Eigen::Vector3d* vector : {&target, &approach, &lateral}) *vector = *fix.axes * *vector;
    if (fix.reverse_approach) approach = -approach;
    if (fix.reverse_lateral) lateral = -lateral;
    if (!fix.move_objects_m.empty()) target -= offset_m[set->object[row]];
  }
}

// Rows whose touches the fix concerns.
std::vector<int> RowsOfTouches(const MeasurementFix& fix, const MeasurementSet& set) {
  std::vector<int> rows;
  for (int row = 0; row < set.size(); ++row)
    if (std::any_of(fix.touches.begin(), fix.touches.end(), [&](const auto& range) {
          return set.touch[row] >= range.first && set.touch[row] <= range.second;
        }))
      rows.push_back(row);
  return rows;
}

// Names in the order in which the rows have them first, as in a file; those that no row has any more are gone.
void NumberObjects(const std::vector<std::string>& name_of_row, MeasurementSet* set) {
  set->objects.clear();
  for (int row = 0; row < set->size(); ++row) {
    const auto found = std::find(set->objects.begin(), set->objects.end(), name_of_row[row]);
    set->object[row] = static_cast<int>(found - set->objects.begin());
    if (found == set->objects.end()) set->objects.push_back(name_of_row[row]);
  }
}

// A part of the file is fixed like a file of its own.
absl::StatusOr<std::vector<int>> ApplyToTouches(const MeasurementFix& fix, MeasurementSet* set) {
  const std::vector<int> rows = RowsOfTouches(fix, *set);
  if (rows.empty()) return Refused(*set, "has none of these touches");
  MeasurementFix rest = fix;
  rest.touches.clear();
  MeasurementSet part = *set;
  KeepRows(rows, &part);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int> left_of_part, ApplyFix(rest, &part));

  std::vector<char> kept(set->size(), 1);
  for (const int row : rows) kept[row] = 0;
  std::vector<std::string> names;
  for (const int object : set->object) names.push_back(set->objects[object]);
  for (size_t j = 0; j < left_of_part.size(); ++j) {
    const int row = rows[left_of_part[j]];
    kept[row] = 1;
    names[row] = part.objects[part.object[j]];
    std::copy_n(&part.time_s[j * set->fingers], set->fingers,
                &set->time_s[static_cast<size_t>(row) * set->fingers]);
    if (!set->has_poses) continue;
    set->target_m[row] = part.target_m[j];
    set->approach[row] = part.approach[j];
    set->lateral[row] = part.lateral[j];
    set->standoff_m[row] = part.standoff_m[j];
    set->speed_m_s[row] = part.speed_m_s[j];
  }
  std::vector<int> left;
  for (int row = 0; row < static_cast<int>(kept.size()); ++row)
    if (kept[row]) left.push_back(row);
  if (left.size() < kept.size()) {
    KeepRows(left, set);
    Keep(left, 1, &names);
  }
  NumberObjects(names, set);
  return left;
}

}  // namespace

bool MeasurementFix::empty() const {
  return !plain_text && !drop_duplicates && !drop_stale && shift_rows == 0 && finger_order.empty() &&
         rename_objects.empty() && scale_times == 1 && scale_targets == 1 && scale_standoff == 1 &&
         scale_speed == 1 && !axes && !reverse_approach && !reverse_lateral && move_objects_m.empty();
}

bool RepeatsRow(const MeasurementSet& set, int row, int lag) {
  if (row < lag) return false;
  int reported = 0;
  bool differ = false;
  double first_s = NAN;
  for (int i = 0; i < set.fingers; ++i) {
    const double time_s = set.TimeS(row, i), before_s = set.TimeS(row - lag, i);
    if (time_s != before_s && !(std::isnan(time_s) && std::isnan(before_s))) return false;
    if (std::isnan(time_s)) continue;
    if (reported++ == 0) first_s = time_s;
    differ |= time_s != first_s;
  }
  return reported >= 2 && differ;
}

absl::StatusOr<std::vector<int>> ApplyFix(const MeasurementFix& fix, MeasurementSet* set) {
  if (!fix.touches.empty()) return ApplyToTouches(fix, set);
  TOUCHSTONE_RETURN_IF_ERROR(CheckFix(fix, *set));
  std::vector<int> left(set->size());
  std::iota(left.begin(), left.end(), 0);
  const auto keep = [&](const std::vector<int>& rows) {
    if (rows.size() == left.size()) return;
    KeepRows(rows, set);
    Keep(rows, 1, &left);
  };
  if (fix.drop_duplicates) keep(RowsWithoutDuplicates(*set));
  if (fix.drop_stale) keep(RowsThatAreNotStale(*set));
  if (fix.shift_rows != 0) keep(ShiftTimes(fix.shift_rows, set));
  if (!fix.finger_order.empty()) OrderFingers(fix.finger_order, set);
  if (!fix.rename_objects.empty()) RenameObjects(fix.rename_objects, set);
  if (fix.scale_times != 1)
    for (double& time_s : set->time_s) time_s *= fix.scale_times;
  if (set->has_poses) MovePoses(fix, set);
  return left;
}

std::string FixOptions(const MeasurementFix& fix, int fingers) {
  std::vector<std::string> options;
  const auto name = [fingers](int finger) { return model::FingerName(finger, fingers); };
  if (!fix.touches.empty()) {
    std::vector<std::string> ranges;
    for (const auto& [first, last] : fix.touches)
      ranges.push_back(first == last ? absl::StrCat(first) : absl::StrCat(first, "-", last));
    options.push_back("--touches " + absl::StrJoin(ranges, ","));
  }
  if (fix.plain_text) options.push_back("--plain");
  if (fix.drop_duplicates) options.push_back("--drop-duplicates");
  if (fix.drop_stale) options.push_back("--drop-stale");
  if (fix.shift_rows != 0) options.push_back(absl::StrCat("--shift-rows=", fix.shift_rows));
  if (!fix.finger_order.empty()) {
    std::vector<std::string> moved, all;
    for (size_t i = 0; i < fix.finger_order.size(); ++i) {
      all.push_back(name(fix.finger_order[i]));
      if (fix.finger_order[i] != static_cast<int>(i)) moved.push_back(name(static_cast<int>(i)));
    }
    options.push_back(moved.size() == 2 ? absl::StrCat("--swap-fingers ", absl::StrJoin(moved, ","))
                                        : absl::StrCat("--finger-order ", absl::StrJoin(all, ",")));
  }
  for (std::string& option : RenameOptions(fix.rename_objects)) options.push_back(std::move(option));
  const auto scale = [&](const char* option, double factor) {
    if (factor != 1) options.push_back(absl::StrCat(option, " ", ShortestNumber(factor)));
  };
  scale("--scale-times", fix.scale_times);
  if (fix.scale_targets == fix.scale_standoff) {
    scale("--scale-lengths", fix.scale_targets);
  } else {
    scale("--scale-targets", fix.scale_targets);
    scale("--scale-standoff", fix.scale_standoff);
  }
  scale("--scale-speed", fix.scale_speed);
  if (fix.axes) options.push_back("--permute-axes=" + FormatAxes(*fix.axes));
  if (fix.reverse_approach) options.push_back("--reverse-approach");
  if (fix.reverse_lateral) options.push_back("--reverse-lateral");
  for (const auto& [object, moved_m] : fix.move_objects_m) {
    std::vector<std::string> numbers;
    for (int axis = 0; axis < 3; ++axis)
      numbers.push_back(ShortestNumber(std::round(moved_m[axis] * 1e6) / 1e3 + 0.0));
    options.push_back("--move-object " + ShellWord(absl::StrCat(object, "=", absl::StrJoin(numbers, ","))));
  }
  return absl::StrJoin(options, " ");
}

absl::StatusOr<Eigen::Matrix3d> ParseAxes(absl::string_view text) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  const std::vector<absl::string_view> parts = absl::StrSplit(text, ',');
  bool good = parts.size() == 3;
  for (size_t row = 0; good && row < 3; ++row) {
    absl::string_view part = absl::StripAsciiWhitespace(parts[row]);
    const double sign = absl::StartsWith(part, "-") ? -1 : 1;
    if (absl::StartsWith(part, "-") || absl::StartsWith(part, "+")) part.remove_prefix(1);
    const size_t axis = part.size() == 1 ? absl::string_view("xyz").find(part[0]) : absl::string_view::npos;
    good = axis != absl::string_view::npos && axes.col(static_cast<int>(axis)).isZero();
    if (good) axes(static_cast<int>(row), static_cast<int>(axis)) = sign;
  }
  if (good) return axes;
  return absl::InvalidArgumentError(absl::StrCat(
      "'", text, "': the axes that the new x, y and z have in the file were expected, for instance -y,x,z"));
}

std::string FormatAxes(const Eigen::Matrix3d& axes) {
  std::string text;
  for (int row = 0; row < 3; ++row) {
    int axis = 0;
    axes.row(row).cwiseAbs().maxCoeff(&axis);
    absl::StrAppend(&text, row > 0 ? "," : "", axes(row, axis) < 0 ? "-" : "", std::string(1, "xyz"[axis]));
  }
  return text;
}

}  // namespace touchstone::session
