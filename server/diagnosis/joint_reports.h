// Touches and photographs of one session in one diagnosis: blunders of either kind, what both see of the objects
// (joint/), what each kind shows beside that, one report.
//
// Pure functions of their input, durations aside, whatever the number of threads.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis {

// `input.set`, with poses, and `input.images` are set. Errors of the improved model are those that a comparison of both with
// it finds. Error: INVALID_ARGUMENT for touches without poses, and what either kind's diagnosis says.
absl::StatusOr<v1::Report> DiagnoseJointSet(const DiagnosisInput& input, const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
