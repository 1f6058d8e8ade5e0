// Where kinds of measurement want different values of one effect.
#pragma once

#include <vector>

#include "server/diagnosis/joint/shared_effects.h"
#include "server/diagnosis/joint/shared_search.h"

namespace touchstone::diagnosis::joint {

// Of the effects that each kind alone has, where values of their own explain more than the best of one value. Errors as FitModel.
absl::StatusOr<std::vector<Conflict>> FindConflicts(const Sides& sides, const SharedSelection& selection);

}  // namespace touchstone::diagnosis::joint
