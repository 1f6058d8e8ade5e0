// Verdicts that are reached before any effect is fitted: a mistake in the file, or too few touches to say anything.
#pragma once

#include <vector>

#include <absl/status/status.h>

#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis {

// kCheckData: how wrong the model is on the file as it stands, and the mistakes; no step.
report::Diagnosis CheckDataReport(const DiagnosisInput& input, const DiagnosisContext& context,
                                  const std::vector<engine::DataProblem>& problems);

// A refusal of the set (INVALID_ARGUMENT) with the command that corrects the mistake behind it, where there is one; others stay.
absl::Status WithFix(const absl::Status& refusal, const DiagnosisInput& input,
                     const DiagnosisContext& context);

// How many usable touches a verdict needs if there are too few of them; 0: there are enough.
int TouchesNeeded(const touches::Observations& observations);

// kTooLittleData: how wrong the model is as far as can be said.
report::Diagnosis TooLittleDataReport(const selection::Workspace& workspace, int touches_needed);

}  // namespace touchstone::diagnosis
