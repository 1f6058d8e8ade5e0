// Whether a set's session clock runs on from row to row.
#pragma once

#include <cstdint>

#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {

// Rows whose session_time_s is less than that of the row before.
struct BackwardTimes {
  int rows = 0;
  // Of the first: its touch's number, its time and the time before, seconds.
  uint64_t touch = 0;
  double time_s = 0, before_s = 0;
};

// None of a set without session times.
BackwardTimes FindBackwardTimes(const MeasurementSet& set);

}  // namespace touchstone::session
