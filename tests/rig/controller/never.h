// The time at which something happens that does not happen.
#pragma once

#include <limits>

namespace touchstone::rig {

inline constexpr double kNever = std::numeric_limits<double>::infinity();

}  // namespace touchstone::rig
