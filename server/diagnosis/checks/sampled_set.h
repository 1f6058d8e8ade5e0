// The touches on which mistakes are tried: a part of the set, spread over objects, poses and time.
#pragma once

#include <memory>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::checks {

// About so many touches are enough: with 160 the right mistake came first in 5 of 5 sets, at a fiftieth of the error,
// and the next one at 0.38. Sets of many objects take at least kMinPerObject of each.
inline constexpr int kSampled = 160;
inline constexpr int kMinPerObject = 8;

// Rows of the set, ascending; touches that are not used have no part. The same observations give the same rows.
std::vector<int> SampleRows(const touches::Observations& observations);

// These rows of the set alone. `shift`: with the times of as many rows before, as session::MeasurementFix has it;
// nothing where there is no such row.
std::shared_ptr<session::MeasurementSet> PartOf(const session::MeasurementSet& set,
                                                const std::vector<int>& rows, int shift);

}  // namespace touchstone::diagnosis::checks
