// Touches and photographs of one session in one diagnosis: data errors of either kind, what both see of the objects
// (joint/), what each kind shows beside that.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

// As Compare and Diagnose (diagnose.h), of `input.set` and `input.images`. Errors of the improved model are those that a
// comparison of both with it finds. Error of DiagnoseJointSet: INVALID_ARGUMENT for touches without poses, and what either
// kind's diagnosis says.
absl::StatusOr<report::Diagnosis> CompareJointSet(const DiagnosisInput& input,
                                                  const DiagnosisContext& context);
absl::StatusOr<report::Diagnosis> DiagnoseJointSet(const DiagnosisInput& input,
                                                   const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
