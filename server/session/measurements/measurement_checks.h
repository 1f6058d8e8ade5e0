// What every measurement set must be, whether it was read from a file or put together otherwise.
#pragma once

#include <absl/status/status.h>

#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {

inline constexpr size_t kMaxObjectNameBytes = 256;

// A touch number that stands twice would make "touch 17" ambiguous, and hints at a file pasted twice.
absl::Status CheckTouchNumbers(const MeasurementSet& set);

// Whether a set that was put together elsewhere, a message for instance, is one that a file could have been read as:
// columns of equal length, values in range, every touch number once. Makes the vectors exact. Errors name the
// origin, the line that the row would have in a file, and the value.
absl::Status CheckMeasurementSet(MeasurementSet* set, const MeasurementLimits& limits = {});

}  // namespace touchstone::session
