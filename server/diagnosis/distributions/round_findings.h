// What the repeats of a set without poses show among themselves, whatever the poses were: a course through the session,
// an after-effect of the previous press, wild readings, ticks of a polling loop. Each finding names the effects that
// would do that, never one culprit.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/distributions/pose_free_experiment.h"

namespace touchstone::diagnosis::distributions {

enum class RoundFindingKind { kSession, kPreviousPress, kTails, kTicks };

struct RoundFinding {
  RoundFindingKind kind = RoundFindingKind::kSession;
  double p_value = 1;                   // of as much by chance, paid for every test
  std::string words;                    // a sentence for people, without p
  std::vector<std::string> compatible;  // effects of the catalogue
};

// Those with p below 1e-4, in the order of the kinds. Tests of order exchange the touches of a pose: whatever poses and
// shapes do, repeats may change places if nothing depends on the session. Tails are judged against Gaussian noise of
// the same layout. What the given model has already (ticks, tails) is no finding. A pure function of the experiment.
std::vector<RoundFinding> FindInRounds(const PoseFreeExperiment& experiment);

// The tick, s, of which all these times (s, from the first finger's contact) are multiples; 0: none that stands out.
double CommonTick(const std::vector<double>& time_s);

}  // namespace touchstone::diagnosis::distributions
