#include "server/session/measurements/measurement_checks.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/over_limit.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"
#include "server/model/model.h"
#include "server/session/csv/csv_fields.h"

namespace touchstone::session {
namespace {

absl::Status WrongText(const MeasurementSet& set, int row, absl::string_view what, absl::string_view value) {
  return absl::InvalidArgumentError(absl::StrCat(set.origin, ":", set.line[row], ": touch ", set.touch[row],
                                                 ": ", what, " (", value, ") is out of range"));
}

absl::Status WrongValue(const MeasurementSet& set, int row, absl::string_view what, double value) {
  return WrongText(set, row, what, ShortestNumber(value));
}

// Every column has an entry per touch, or none where it may be missing.
absl::Status CheckSizes(const MeasurementSet& set) {
  const size_t rows = set.object.size(), poses = set.has_poses ? rows : 0;
  bool fits = rows > 0 && set.touch.size() == rows && set.line.size() == rows &&
              set.session_time_s.size() == rows && set.target_m.size() == poses &&
              set.approach.size() == poses && set.lateral.size() == poses && set.standoff_m.size() == poses &&
              set.speed_m_s.size() == poses && set.fingers >= 0 && set.fingers <= model::kMaxFingers &&
              set.time_s.size() == rows * set.fingers;
  for (const std::vector<int>* column : {&set.round, &set.face})
    fits = fits && (column->empty() || column->size() == rows);
  for (const auto& [name, values] : set.covariates) fits = fits && values.size() == rows;
  if (fits) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(set.origin, ": columns of one length, of at least one touch, were expected"));
}

absl::Status CheckPose(MeasurementSet* set, int row) {
  const Eigen::Vector3d& target_m = set->target_m[row];
  if (!(target_m.cwiseAbs().maxCoeff() <= kMaxTargetM) || !target_m.allFinite())
    return WrongText(*set, row, "target_m", VectorText(target_m));
  if (!(set->standoff_m[row] >= 0 && set->standoff_m[row] <= kMaxStandoffM))
    return WrongValue(*set, row, "standoff_m", set->standoff_m[row]);
  if (!(set->speed_m_s[row] > 0 && set->speed_m_s[row] <= kMaxSpeedMS))
    return WrongValue(*set, row, "speed_m_s", set->speed_m_s[row]);
  switch (MakeOrthonormal(&set->approach[row], &set->lateral[row])) {
    case VectorFlaw::kNone:
      return absl::OkStatus();
    case VectorFlaw::kApproachLength:
      return WrongValue(*set, row, "the length of approach", set->approach[row].norm());
    case VectorFlaw::kLateralLength:
      return WrongValue(*set, row, "the length of lateral", set->lateral[row].norm());
    case VectorFlaw::kNotPerpendicular:
      break;
  }
  return WrongValue(*set, row, "the dot product of approach and lateral",
                    set->approach[row].dot(set->lateral[row]));
}

// Before anything is looked at row by row.
absl::Status CheckLimitsOf(const MeasurementSet& set, const MeasurementLimits& limits) {
  constexpr size_t kPoseColumns = 13;
  const size_t columns = kPoseColumns + set.fingers + set.covariates.size() + (set.has_session_time ? 1 : 0) +
                         (set.round.empty() ? 0 : 1) + (set.face.empty() ? 0 : 1);
  const auto origin = [&](const char* what) { return absl::StrCat(set.origin, ": ", what, ":"); };
  if (set.object.size() > limits.max_touches)
    return OverLimit(origin("touches"), set.object.size(), "max_session_touches", limits.max_touches);
  if (set.objects.size() > limits.max_objects)
    return OverLimit(origin("objects"), set.objects.size(), "max_session_objects", limits.max_objects);
  if (columns > limits.max_columns)
    return OverLimit(origin("columns"), columns, "max_session_columns", limits.max_columns);
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckTouchNumbers(const MeasurementSet& set) {
  bool increasing = true;
  for (int k = 1; k < set.size() && increasing; ++k) increasing = set.touch[k - 1] < set.touch[k];
  if (increasing) return absl::OkStatus();
  std::vector<int> order(set.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return set.touch[a] < set.touch[b]; });
  // The first line that repeats a number.
  int repeated = set.size(), first = 0;
  for (int k = 1; k < set.size(); ++k)
    if (set.touch[order[k - 1]] == set.touch[order[k]] && order[k] < repeated) {
      repeated = order[k];
      first = order[k - 1];
    }
  if (repeated == set.size()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(set.origin, ":", set.line[repeated], ": column touch: ", set.touch[repeated],
                   " stands on line ", set.line[first], " already; every touch needs a number of its own"));
}

absl::Status CheckMeasurementSet(MeasurementSet* set, const MeasurementLimits& limits) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckLimitsOf(*set, limits));
  TOUCHSTONE_RETURN_IF_ERROR(CheckSizes(*set));
  for (const std::string& object : set->objects)
    if (object.empty() || object.size() > kMaxObjectNameBytes || !IsText(object))
      return absl::InvalidArgumentError(absl::StrCat(set->origin, ": an object's name has at most ",
                                                     kMaxObjectNameBytes,
                                                     " bytes of UTF-8 without control characters"));
  for (int row = 0; row < set->size(); ++row) {
    if (set->object[row] < 0 || set->object[row] >= static_cast<int>(set->objects.size()))
      return WrongValue(*set, row, "object", set->object[row]);
    if (!(set->session_time_s[row] >= 0 && set->session_time_s[row] <= kMaxSessionTimeS))
      return WrongValue(*set, row, "session_time_s", set->session_time_s[row]);
    if (set->has_poses) TOUCHSTONE_RETURN_IF_ERROR(CheckPose(set, row));
    for (int finger = 0; finger < set->fingers; ++finger)
      if (const double time_s = set->TimeS(row, finger);
          !std::isnan(time_s) && !(time_s >= 0 && time_s * 1e6 <= limits.max_time_us))
        return WrongValue(*set, row, "a contact time", time_s);
  }
  for (const auto& [name, values] : set->covariates)
    for (int row = 0; row < set->size(); ++row)
      if (std::isinf(values[row])) return WrongValue(*set, row, name, values[row]);
  return CheckTouchNumbers(*set);
}

}  // namespace touchstone::session
