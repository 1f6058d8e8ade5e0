// Whether photographs look like data of the given model, over every effect, curve and odd picture that is tried.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/nothing_missing.h"
#include "server/diagnosis/images/photo_search.h"

namespace touchstone::diagnosis::images {

// `search`: its rows are made at the given model, with every candidate. The noise is that of pixels, and of the contours' place
// as far as that cannot be told from noise; its size is taken from the data, so that another sigma alone is no sign that
// something is missing. Errors as ExpectPhotographs and FitModel.
absl::StatusOr<engine::TriedPValues> TryOnPhotographs(const DiagnosisInput& input,
                                                      const Photographs& photographs,
                                                      const PhotoSearch& search,
                                                      const DiagnosisContext& context);

}  // namespace touchstone::diagnosis::images
