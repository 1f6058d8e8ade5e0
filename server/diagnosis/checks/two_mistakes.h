// Two mistakes at once: fingers permuted and times in tenths, names exchanged and the frame turned.
#pragma once

#include <utility>
#include <vector>

#include "server/diagnosis/checks/tried.h"

namespace touchstone::diagnosis::checks {

// The pair that explains the misfit best, first what is done first; empty: none does twice as well as one mistake
// must. Tried only where the model explains little of the data, for it takes thousands of trials.
std::vector<Mistake> TwoMistakes(const DiagnosisInput& input, const std::vector<int>& rows,
                                 const TrialResult& before, ThreadPool* pool);

}  // namespace touchstone::diagnosis::checks
