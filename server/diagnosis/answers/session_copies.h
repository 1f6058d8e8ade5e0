// Sessions that hold the same measurements.
#pragma once

#include <vector>

#include <absl/status/status.h>

#include "server/diagnosis/input.h"

namespace touchstone::diagnosis {

// INVALID_ARGUMENT, with both names, where touches of one session stand in another to the last digit: by the rule for
// duplicates within one file (checks/rows/duplicates.h), and where all that two sessions measured is equal. Counted twice
// they would make everything too certain.
absl::Status CheckCopies(const std::vector<DiagnosisInput>& sessions);

}  // namespace touchstone::diagnosis
