// Which photographs to take next: propose.h for pictures.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/images/photo_explanations.h"
#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::design {

// At most `max_photographs` pictures that tell the explanations apart that are left, most informative first; one
// explanation: where its values would be learnt best. A picture is worth what two explanations expect differently of it
// *after* one of them has been fitted again to all pictures, the new ones included (sequential_choice.h), in standard
// deviations of the pixels' noise. Candidates: ListViews. Empty if no picture would discriminate: then only another kind
// of measurement does. Deterministic for a seed, whatever the pool.
absl::StatusOr<std::vector<images::ProposedPhotograph>> ProposePhotographs(
    const images::Photographs& photographs, const images::ExplanationsLeft& left, int max_photographs,
    uint64_t seed, ThreadPool* pool);

// Pictures for a set that holds too few for a verdict: `count` from where the objects were not seen yet.
std::vector<images::ProposedPhotograph> PhotographsToBegin(const images::Photographs& photographs, int count,
                                                           uint64_t seed);

}  // namespace touchstone::diagnosis::design
