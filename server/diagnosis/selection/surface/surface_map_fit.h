// The departure of the surfaces from their meshes that residuals show, as a map for the model.
#pragma once

#include "server/diagnosis/selection/surface/surface_support.h"

namespace touchstone::diagnosis::selection {

// Of the residuals of `fit`, with the size and the length of the bumps that `support` has found: their posterior mean
// and standard deviation at the contacts (model/surface_map.md says what holds between them).
absl::StatusOr<std::shared_ptr<const model::Effect>> FitSurfaceMap(const Workspace& workspace,
                                                                   const engine::Fit& fit,
                                                                   const SurfaceSupport& support);

}  // namespace touchstone::diagnosis::selection
