// The sentences about a set without poses.
#pragma once

#include <string>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// One paragraph. `diagnosis` has one entry, with distributions.
std::string SummarizeDistributions(const Diagnosis& diagnosis);

}  // namespace touchstone::diagnosis::report
