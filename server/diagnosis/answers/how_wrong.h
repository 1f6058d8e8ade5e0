// What a diagnosis of touches begins with: which model, which data, and how wrong the model is on them.
#pragma once

#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis {

// Model and data, nothing else.
report::Diagnosis BeginDiagnosis(const selection::Workspace& workspace);

// The entry of data of the touches, without errors.
report::DataReport DataOf(const touches::Observations& observations, const DiagnosisInput& input);

// Error, noise floor and lack of fit of the model as it was given. Nothing without a touch that can be used.
void AddHowWrong(const selection::Workspace& workspace, const std::vector<double>& residuals,
                 report::Diagnosis* diagnosis);

}  // namespace touchstone::diagnosis
