// What touches may be lacking: the effects that a search tries.
#pragma once

#include <vector>

#include "server/diagnosis/engine/search/candidates.h"
#include "server/diagnosis/input.h"
#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

// Every effect of the catalogue that changes expectations and that the model does not have yet; behind the same on all
// objects, each with a value for every object and on one object only; and the user's own. `searched`: the touches of the search.
std::vector<engine::Candidate> MakeCandidates(const DiagnosisInput& input,
                                              const touches::Observations& searched);

}  // namespace touchstone::diagnosis::selection
