// Photographs from the first check to the report: blunders of the set (checks/), the engine (images/), what differs where
// (residuals/), messages (report/). With touches of the same session beside them one joint report.
//
// Pure functions of their input, durations aside, whatever the number of threads.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis {

// How wrong and where. `input.images` is set; `input.set` too for a joint report.
absl::StatusOr<v1::Report> ComparePhotographSet(const DiagnosisInput& input, const DiagnosisContext& context);

// Also why, what to add, and what the error becomes; with touches beside the photographs of both together
// (joint_reports.h). Errors of the improved model are those that a comparison with it finds.
absl::StatusOr<v1::Report> DiagnosePhotographSet(const DiagnosisInput& input,
                                                 const DiagnosisContext& context);

// Diagnose, with at most `max_photographs` further pictures that would tell the explanations apart that the photographs
// alone leave: touches beside them must have been taken out.
absl::StatusOr<v1::Report> ProposePhotographSet(const DiagnosisInput& input, int max_photographs,
                                                const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
