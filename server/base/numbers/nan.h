// The number that stands where there is none: a finger that felt nothing, a value that was not measured.
#pragma once

#include <limits>

namespace touchstone {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace touchstone
