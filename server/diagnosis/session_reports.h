// Several sessions of touches in one comparison or diagnosis: how wrong one model is in each, which values they share and
// which changed between them, and whether the poses that two of them touched agree whatever the model.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

// As Compare and Diagnose (diagnose.h) of two sessions or more, in the order in which they were made: an entry of data each.
// The model, the seed and everything but set and surfaces are the first's. The improved model is that of the last session
// that has enough touches. Errors: INVALID_ARGUMENT for photographs, sets without poses, a second model; else as of one
// session.
absl::StatusOr<report::Diagnosis> CompareSessions(const std::vector<DiagnosisInput>& sessions,
                                                  const DiagnosisContext& context);
absl::StatusOr<report::Diagnosis> DiagnoseSessions(const std::vector<DiagnosisInput>& sessions,
                                                   const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
