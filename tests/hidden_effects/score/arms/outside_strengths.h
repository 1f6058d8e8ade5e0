// How strong causes outside the catalogue are, and what else they are drawn with.
#pragma once

#include <random>

#include "tests/hidden_effects/generator/generate.h"
#include "tests/hidden_effects/score/arms/arms.h"

namespace touchstone::hidden {

// A cause of this kind: its further numbers drawn from the seed, its size such that the times it changes add up to 10 to
// 15 standard errors over the set (weak), or to an RMS of 0.8 to 1.5 (realistic) or 3 to 6 sigmas (strong); two fifths
// of these where the whole set shows each draw only once per pose or round.
Cause DrawnCause(CauseKind kind, const Scenario& scenario, uint64_t seed, Strength strength);

// sqrt(sum ||P (with - without)||^2) / sigma over the reported times; of causes that depend on time alone without the
// straight line of each finger, which a length and a drift would explain.
double SignalOf(const Cause& cause, const Scenario& scenario, uint64_t seed);

// An effect of the catalogue beyond the bounds that it has there: by a sixth (weak), half as much again to twice
// (realistic), 2.5 to 4 times (strong).
Hidden BeyondBound(const Scenario& scenario, uint64_t seed, Strength strength);

// A mistake of this kind, with a number that people make it with.
DataError DrawnDataError(DataErrorKind kind, const Scenario& scenario, uint64_t seed, Strength strength);

}  // namespace touchstone::hidden
