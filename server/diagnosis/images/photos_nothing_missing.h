// Whether photographs look like data of the given model, over every effect, curve and odd picture that is tried.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/nothing_missing.h"
#include "server/diagnosis/engine/result.h"
#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

// `before`: what the given model expects, with details; `initial`: its quality. The noise is that of pixels, and of the
// contours' place as far as it cannot be told from noise; its size is taken from the data, so that another sigma alone is no
// sign that something is missing. Errors as ExpectPhotographs.
absl::StatusOr<engine::TriedPValues> TryOnPhotographs(const DiagnosisInput& input,
                                                      const Photographs& photographs,
                                                      const std::vector<image::Photo>& before,
                                                      const engine::Quality& initial,
                                                      const DiagnosisContext& context);

}  // namespace touchstone::diagnosis::images
