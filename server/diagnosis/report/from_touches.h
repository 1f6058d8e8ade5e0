// What touches show, in us.
#pragma once

#include <vector>

#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/selection/ladder.h"

namespace touchstone::diagnosis::report {

// The set, without errors.
DataReport DataOfTouches(const touches::DataSummary& set);

Quality InMicroseconds(const engine::Quality& quality);
NoiseFloor NoiseFloorOf(const engine::NoiseFloor& floor);
DataProblem DataProblemOfTouches(const engine::DataProblem& problem);

// Verdict, causes and errors; `diagnosis` has one entry, with its initial error.
void AddLadder(const selection::Ladder& ladder, Diagnosis* diagnosis);

// Where the model is wrong.
void AddResiduals(residuals::ResidualSummary residuals, DataReport* data);

}  // namespace touchstone::diagnosis::report
