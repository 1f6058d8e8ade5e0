// The report of a plan that is not measured yet.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/design/plan_check.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

// See Check (diagnose.h).
absl::StatusOr<report::Diagnosis> CheckTouchPlan(const DiagnosisInput& input,
                                                 const design::PlanQuestion& question,
                                                 const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
