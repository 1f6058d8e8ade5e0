// What the order of a session and its speeds leave open about an explanation, for people.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

// Of an effect that acts on one object only, or on each in its own measure, where the touches of an object are one stretch of the
// session: a change in time would look alike. `only`: the object; empty: each has its own of `values`, which may grow steadily in
// the order of touching. `own_by_nature`: objects have such values of their own, and only growth is odd. Empty: the order of the
// touches tells the two apart.
std::string OrderInWords(const touches::Observations& observations, const std::string& only,
                         const std::vector<engine::ParameterEstimate>& values, bool own_by_nature);

// Pairs of steps (indices into `steps`) that differ by nothing but how they depend on the speed, where the searched touches
// have two speeds: any dependence on the speed is some sum of the two.
std::vector<std::pair<size_t, size_t>> PairsAtTwoSpeeds(const touches::Observations& searched,
                                                        const std::vector<int>& touch_of_row,
                                                        const engine::Fit& fit,
                                                        const std::vector<engine::SelectedStep>& steps);

}  // namespace touchstone::diagnosis::selection
