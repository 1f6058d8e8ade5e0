// A column of times that was sorted alone: each value is real, but belongs to another row.
#pragma once

#include "server/diagnosis/checks/trial.h"

namespace touchstone::diagnosis::checks {

// The finger whose column rises or falls from the first row to the last although the model expects it to go up and
// down; -1: none.
int SortedColumn(const DiagnosisInput& input);

}  // namespace touchstone::diagnosis::checks
