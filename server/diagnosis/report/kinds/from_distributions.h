// What a set without poses shows: compared as distributions, in us.
#pragma once

#include "server/diagnosis/distributions/pose_free.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// `input` is what was compared.
Diagnosis FromDistributions(const DiagnosisInput& input, distributions::PoseFreeComparison comparison);

}  // namespace touchstone::diagnosis::report
