#include "server/session/measurements/backward_times.h"

namespace touchstone::session {

BackwardTimes FindBackwardTimes(const MeasurementSet& set) {
  BackwardTimes found;
  if (!set.has_session_time) return found;
  for (int row = 1; row < set.size(); ++row) {
    const double before_s = set.session_time_s[row - 1], time_s = set.session_time_s[row];
    if (!(time_s < before_s)) continue;
    if (found.rows++ == 0) found.touch = set.touch[row], found.time_s = time_s, found.before_s = before_s;
  }
  return found;
}

}  // namespace touchstone::session
