// How strong hidden effects are: of realistic size, or as weak as a given signal over the whole set.
#pragma once

#include <random>
#include <string>

#include "tests/hidden_effects/generator/generate.h"

namespace touchstone::hidden {

// The effects of the catalogue that change expectations and that a search can name, and those that change the
// scatter.
const std::vector<std::string>& EffectsOfExpectation();
const std::vector<std::string>& EffectsOfScatter();

// Values of a realistic size with a random direction, made stronger where the scenario would not show them (less than
// 25 standard errors).
Hidden RealisticEffect(const std::string& effect, const Scenario& scenario, uint64_t seed);

// The exact times of a set, NaN for touches with a finger that meets another face when it moves aside by 0.3 mm: there
// a hair's breadth decides, and nobody can count on them.
std::vector<double> TimesAwayFromEdges(const Set& set);

// The same direction, as weak as this signal (in standard errors over the touches away from edges), found by bisection.
Hidden WeakEffect(const std::string& effect, const Scenario& scenario, uint64_t seed, double signal);

// An unlisted effect whose RMS over the set's residual degrees of freedom is this many sigmas.
Unlisted UnlistedEffect(const std::string& name, const Scenario& scenario, uint64_t seed,
                        double rms_in_sigmas);

}  // namespace touchstone::hidden
