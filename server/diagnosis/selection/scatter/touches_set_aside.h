// Touches that a fit set aside as outliers, and what they share: the object, the round, the face, the finger.
#pragma once

#include "server/diagnosis/engine/search/set_aside.h"
#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

// `residuals` [k * fingers + i], s; `rmse_s`: of all touches that a comparison uses; `noise_s`: the noise floor.
engine::SetAside AssessTouchesSetAside(const touches::Observations& observations,
                                       const std::vector<double>& residuals, double rmse_s, double noise_s);

}  // namespace touchstone::diagnosis::selection
