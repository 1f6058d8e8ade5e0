// Nameless curves against named effects: a name stands only where no curve says the same much better.
#pragma once

#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// After the search: scores curves over what it found. Where one is significant, effects that it makes superfluous
// leave, and it takes the place of the formula in `result` (as a lookup effect) unless a formula does as well. A
// named effect of time that a curve alone nearly equals keeps its place; the curve counts among its competitors.
absl::Status CompeteWithCurves(const Workspace& workspace, SelectionResult* result);

}  // namespace touchstone::diagnosis::selection
