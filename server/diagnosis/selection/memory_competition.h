// Noise with memory against courses in time: correlated noise has no course that another session would repeat, and a curve only
// traces it.
#pragma once

#include <optional>

#include <absl/status/statusor.h>

#include "server/diagnosis/selection/scatter/noise_memory.h"
#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// Of what a fit leaves on the touches of the search.
absl::StatusOr<std::optional<NoiseMemory>> MemoryOf(const Workspace& workspace, const engine::Fit& fit);

// Whether the noise beside `fit` has memory that says more than a course in time, whose curve gains `curve_nats`. Then it is
// in `result`, without effects that are not worth their values under it.
absl::StatusOr<bool> TakeNoiseWithMemory(const Workspace& workspace, const engine::Fit& fit,
                                         double curve_nats, SelectionResult* result);

// The same where no curve was found: asked if repeats share a course in time, or the given model says that they do.
absl::Status LookForMemory(const Workspace& workspace, const engine::Fit& named, SelectionResult* result);

}  // namespace touchstone::diagnosis::selection
