// Effects that a search let in and that the whole explanation does without: no name stands in a report that does not
// predict what it has not seen.
#pragma once

#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// Takes effects out of the explanation, the last one first, whose removal makes the error on touches that were left out
// no worse. Before the competing effects are known. Returns whether there were any. A curve is left as it was fitted.
absl::StatusOr<bool> DropUnseen(const Workspace& workspace, SelectionResult* result);

// Takes out effects that stand beside a rest without a name and in whose place something else is far more probable.
// Returns whether there were any: the steps are then to be found anew.
absl::StatusOr<bool> DropImprobable(const Workspace& workspace, SelectionResult* result);

// Takes effect `index` of the explanation out; everything else but a curve is fitted anew.
absl::Status TakeOut(const Workspace& workspace, int index, SelectionResult* result);

}  // namespace touchstone::diagnosis::selection
