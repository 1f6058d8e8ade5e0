// Whether touches look like data of the given model, over every effect, curve and kind of noise that is tried.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/nothing_missing.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis::selection {

// Of the workspace's touches as its search has them, before any is left out or weighed. The noise is drawn from the given
// model; its size is taken from the data, so that another sigma alone is no sign that something is missing.
absl::StatusOr<engine::TriedPValues> TryOnTouches(const Workspace& workspace,
                                                  const engine::GivenAndEffects& columns);

}  // namespace touchstone::diagnosis::selection
