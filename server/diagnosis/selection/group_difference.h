// Whether a part of the session differs from the rest by one effect: an object that was pushed in one round, a tip that was
// changed half-way. Its mean looks like the effect on all touches and its scatter like noise, and it is neither.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/effect_columns.h"
#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// Compares touches of one pose with one another: what is the same in every touch of a pose, whether the model has it or not,
// takes no part. `found`: the explanation without such a difference, which may explain as much (a drift, a curve of time,
// correlated noise); nothing where it does, where repeats are few, and where the object lay elsewhere in every round.
absl::StatusOr<std::optional<GroupDifference>> FindGroupDifference(const Workspace& workspace,
                                                                   const engine::GivenAndEffects& columns,
                                                                   const SelectionResult& found);

}  // namespace touchstone::diagnosis::selection
