// Touches from the first check to the report: mistakes of the file (checks/), the search (selection/), what differs where
// (residuals/). A set without poses is compared as distributions (distributions/).
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

// As Compare, Diagnose and Propose (diagnose.h), of `input.set`.
absl::StatusOr<report::Diagnosis> CompareTouches(const DiagnosisInput& input,
                                                 const DiagnosisContext& context);
absl::StatusOr<report::Diagnosis> DiagnoseTouches(const DiagnosisInput& input,
                                                  const DiagnosisContext& context);
absl::StatusOr<report::Diagnosis> ProposeTouches(const DiagnosisInput& input, int max_touches,
                                                 const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
