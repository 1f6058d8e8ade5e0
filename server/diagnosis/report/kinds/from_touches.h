// What touches show, in us.
#pragma once

#include <vector>

#include "server/base/units.h"
#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/selection/ladder/ladder.h"

namespace touchstone::diagnosis::report {

// The set, without errors.
DataReport DataOfTouches(const touches::DataSummary& set);

// What the engine finds in seconds, in us: a quality, a candidate, what is unexplained.
template <typename Found>
Found InMicroseconds(Found found) {
  found.rmse = Microseconds(found.rmse);
  found.heldout_rmse = Microseconds(found.heldout_rmse);
  return found;
}
NoiseFloor InMicroseconds(NoiseFloor floor);
DataProblem InMicroseconds(const engine::DataProblem& problem);

// Verdict, causes and errors; `diagnosis` has one entry, with its initial error.
void AddLadder(const selection::Ladder& ladder, Diagnosis* diagnosis);

// A part of the data, from what residuals/ found of it.
Slice SliceOf(const residuals::ErrorSlice& from);

// Where the model is wrong.
void AddResiduals(residuals::ResidualSummary residuals, DataReport* data);

}  // namespace touchstone::diagnosis::report
