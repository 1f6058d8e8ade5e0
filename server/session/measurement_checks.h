// What every measurement set must be, whether it was read from a file or put together otherwise.
#pragma once

#include <absl/status/status.h>

#include "server/session/measurement_set.h"

namespace touchstone::session {

inline constexpr size_t kMaxObjectNameBytes = 256;

// A touch number that stands twice would make "touch 17" ambiguous, and hints at a file pasted twice.
absl::Status CheckTouchNumbers(const MeasurementSet& set);

}  // namespace touchstone::session
