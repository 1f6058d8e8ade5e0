// The step of a ladder that says that the surfaces depart from their meshes.
#pragma once

#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/surface/surface_support.h"

namespace touchstone::diagnosis::selection {

// Adds surface_error, whose size is reported and which takes no error away; or, where the input asks for one and it
// predicts poses that it has not seen, a map of the surfaces, with the errors that it leaves. `lack_of_fit_p`: with the
// surfaces known. Sets the ladder's final errors.
absl::Status AddSurfaceStep(const Workspace& workspace, const SelectionResult& selection,
                            const SurfaceSupport& support, double lack_of_fit_p, Ladder* ladder);

// New size and length of the surface error that the model has.
void RefitSurfaceError(const SurfaceErrorFinding& found, Ladder* ladder);

}  // namespace touchstone::diagnosis::selection
