// Which touches take part in the search for an explanation: some leave as it goes on.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// A few touches that are so far from the given model that beside them nothing else would show.
void LeaveOutWild(Workspace* workspace);

// What a part of the session has for itself says nothing of the rest.
void LeaveOutRows(const GroupDifference& group, touches::Observations* observations);

// Where the better model says that a finger all but misses an edge, outliers, touches of little worth: they leave or
// count less. Returns whether anything changed; `weights`: by row of the set.
absl::StatusOr<bool> ReviseTouches(const SelectionResult& found, const std::vector<int>& outliers,
                                   Workspace* workspace, std::vector<double>* weights);

}  // namespace touchstone::diagnosis::selection
