// What a measurement set says, whatever file it stood in: two copies with other line ends, another order of columns or rows,
// other names or further columns hold the same touches.
#pragma once

#include <string>

#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {

// SHA-256, hex, of the commanded touches and the contact times, in any order of the rows: lengths to 1 nm, times to 1 ns,
// directions and speeds (m/s) to 1e-7. Numbers of touches, names of objects, rounds, session times and covariates do not enter.
std::string TouchContentSha256(const MeasurementSet& set);

}  // namespace touchstone::session
