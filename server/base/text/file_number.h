// SI values as the numbers that files and messages have: what a person sent is what a message about it says.
#pragma once

#include <string>

#include <Eigen/Core>

#include "server/base/units.h"

namespace touchstone {

// The SI value as a number of files: the one of fewest digits (15 to 17) that reads back to the same SI
// value, "30" for 0.030 m. Where no number of files does (a fit may end there), the nearest one; that reads
// back to the same text.
std::string FileNumber(Unit unit, double value_si);

// "(0, 0.1, -1)", each in that unit.
std::string VectorText(const Eigen::Vector3d& value_si, Unit unit = Unit::kNone);

}  // namespace touchstone
