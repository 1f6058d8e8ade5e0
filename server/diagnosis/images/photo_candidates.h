// Every effect that photographs show as the one that is missing.
#pragma once

#include <vector>

#include "server/diagnosis/images/photo_search.h"
#include "server/diagnosis/images/photograph_diagnosis.h"

namespace touchstone::diagnosis::images {

// Each effect as the first step from the given model, best first; those that these photographs cannot see, or that fit
// best where they change nothing, last, with a note. A candidate's error is what a comparison with it alone finds;
// probabilities share 1 with "nothing is missing" and with the nameless image field, which is not listed.
// `floor_grey`: the noise floor.
absl::StatusOr<std::vector<RankedPhotographCandidate>> RankPhotoCandidates(const Photographs& photographs,
                                                                           const PhotoSelection& selection,
                                                                           double floor_grey,
                                                                           ThreadPool* pool);

}  // namespace touchstone::diagnosis::images
