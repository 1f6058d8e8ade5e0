// Photographs from the first check to the report: data errors of the set (checks/), the engine (images/), what differs where
// (residuals/).
#pragma once

#include <optional>

#include <absl/status/statusor.h>

#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

// As Compare, Diagnose and Propose (diagnose.h), of `input.images`.
absl::StatusOr<report::Diagnosis> ComparePhotographSet(const DiagnosisInput& input,
                                                       const DiagnosisContext& context);
absl::StatusOr<report::Diagnosis> DiagnosePhotographSet(const DiagnosisInput& input,
                                                        const DiagnosisContext& context);
absl::StatusOr<report::Diagnosis> ProposePhotographSet(const DiagnosisInput& input, int max_photographs,
                                                       const DiagnosisContext& context);

// Parts of a joint diagnosis: the diagnosis of mistakes of the set, if there are any; and what was found with what differs
// where.
absl::StatusOr<std::optional<report::Diagnosis>> PhotographDataErrors(const DiagnosisInput& input,
                                                                      const DiagnosisContext& context);
report::Diagnosis DescribedPhotographs(const DiagnosisInput& input, const DiagnosisContext& context,
                                       const images::Expectation& expectation,
                                       images::PhotographDiagnosis* found);

}  // namespace touchstone::diagnosis
