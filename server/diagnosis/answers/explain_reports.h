// Reports that answer one question about a set of touches: why (not) one effect, which of two models.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis {

// See Explain (diagnose.h).
absl::StatusOr<report::Diagnosis> ExplainTouches(const DiagnosisInput& input, const std::string& effect,
                                                 const DiagnosisContext& context);

// The second model of `workspace.input` against the first, on the touches that are compared. `data` has the first's errors.
absl::StatusOr<report::Versus> CompareWithOther(const selection::Workspace& workspace,
                                                const report::DataReport& data);

}  // namespace touchstone::diagnosis
