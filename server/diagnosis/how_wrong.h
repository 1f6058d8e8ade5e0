// What a diagnosis of any kind begins with: which model, which data, and how wrong the model is on them.
#pragma once

#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis {

// Model and data, nothing else.
report::Diagnosis BeginDiagnosis(const selection::Workspace& workspace);

// The share of the squared error that is the model's, not noise: 0 to 1.
double ReducibleShare(const engine::NoiseFloor& floor, const engine::Quality& quality);

// Error, noise floor and lack of fit of the model as it was given. Nothing without a touch that can be used.
void AddHowWrong(const selection::Workspace& workspace, const std::vector<double>& residuals,
                 report::Diagnosis* diagnosis);

}  // namespace touchstone::diagnosis
