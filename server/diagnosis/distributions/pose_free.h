// Sets without poses: only objects and times (DESIGN 7). Nothing can be compared touch by touch; what is
// compared are distributions, against sets that the model makes by the same plan. Two orders weaker than a
// set with poses: the report says whether the model is compatible and with which effects it would be, and
// never names one culprit.
#pragma once

#include "server/diagnosis/input.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone {

// `diagnose`: also a verdict, and the effects of the catalogue that would make the sets alike.
//
// The test: the model makes sets exactly like the measured one (objects, touches, rounds; other poses of the
// faces plan), and the measured set's distance to a large simulated reference takes its rank among theirs. If
// the model is right and the plan was that one, every rank is equally probable, whatever the touches of a set
// have in common; so p is exact. Noise is estimated anew first where the set goes in rounds.
absl::StatusOr<v1::Report> CompareUnposed(const DiagnosisInput& input, const DiagnosisContext& context,
                                          bool diagnose);

}  // namespace touchstone
