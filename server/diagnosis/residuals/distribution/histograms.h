// Descriptors and local curvature, measured against simulated: over all touches and object by object.
#pragma once

#include <vector>

#include "server/diagnosis/residuals/distribution/histogram_bins.h"
#include "server/diagnosis/residuals/distribution/scale.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

// Times of both models get noise of scale.sigma_s, the same for both. The p of each histogram are those of
// PosePermutationP. Empty with fewer than two fingers; curvature only with three. Deterministic.
std::vector<ComparedHistogram> MakeHistograms(const touches::Observations& observations,
                                              const touches::Prediction& initial,
                                              const touches::Prediction& improved,
                                              const ResidualScale& scale);

}  // namespace touchstone::diagnosis::residuals
