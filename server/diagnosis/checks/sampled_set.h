// The touches on which mistakes are tried: a part of the set, spread over objects, poses and time.
#pragma once

#include <memory>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::checks {

// Rows of the set, ascending; touches that are not used have no part. The same observations give the same rows.
std::vector<int> SampleRows(const touches::Observations& observations);

// These rows of the set alone. `shift`: with the times of as many rows before, as session::MeasurementFix has it;
// nothing where there is no such row.
std::shared_ptr<session::MeasurementSet> PartOf(const session::MeasurementSet& set,
                                                const std::vector<int>& rows, int shift);

}  // namespace touchstone::diagnosis::checks
