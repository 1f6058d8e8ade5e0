// What a report says about a set without poses, but for the verdict.
#pragma once

#include <string>

#include "server/diagnosis/distributions/pose_free_rank.h"

namespace touchstone {

std::string PlanInWords(const UnposedCase& the_case, const SupposedPoses& poses, bool fitted);

// Model, fingers, rows used and unused, and what the rounds say about the noise.
void FillUnposedData(const UnposedCase& the_case, v1::Report* report);
// `distributions` (but for compatible effects), `initial`, histograms and warnings.
void FillUnposedComparison(const UnposedCase& the_case, const UnposedRank& rank, bool poses_fitted,
                           v1::Report* report);

}  // namespace touchstone
