// A mistake in a part of the file: one round measured with two cables exchanged, touches of one object under the name
// of another, times one row off from somewhere on. Each touch that was tried is either as told or as the mistake has
// it; the cheapest division, in which every change costs something, is the part.
//
// It is claimed where the fix explains the part as a mistake of the whole file must be explained (tried.h), and where
// the rest of the file is right as it stands: what is wrong everywhere is no part.
#pragma once

#include <vector>

#include "server/diagnosis/checks/tried.h"

namespace touchstone::diagnosis::checks {

// Those that fit alike, each with the touches that it concerns (Mistake::fix.touches; empty where they are too
// scattered for a command) and with words that count them. `tried`: mistakes of the whole file.
std::vector<Mistake> PartMistakes(const Trial& trial, const TrialResult& before,
                                  const std::vector<Tried>& tried);

// Says of which rows the mistake is, in its words, its detail and its fix.
void ConfineTo(const session::MeasurementSet& set, const std::vector<int>& rows, Mistake* mistake);

// Those that explain the trial's rows by themselves, which are a part of the file that the rest disagrees with.
std::vector<Mistake> MistakesOfRows(const Trial& trial, ThreadPool* pool);

}  // namespace touchstone::diagnosis::checks
