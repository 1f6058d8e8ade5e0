// How wrong is a model on photographs, why, and what to do: what diagnosis/diagnose.h says of touches.
//
// Pure functions of their input, durations aside, whatever the number of threads. They never fail because the data are
// poor. They fail on input that contradicts itself (an object without a mesh) and when cancelled. Where the pictures
// differ, data problems and sentences are others' to fill in.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

// How wrong. The verdict is kNone.
absl::StatusOr<PhotographDiagnosis> ComparePhotographs(const DiagnosisInput& input,
                                                       const DiagnosisContext& context,
                                                       Expectation* expectation = nullptr);

// Also why, what to add, and what the error becomes.
absl::StatusOr<PhotographDiagnosis> DiagnosePhotographs(const DiagnosisInput& input,
                                                        const DiagnosisContext& context,
                                                        Expectation* expectation = nullptr);

}  // namespace touchstone::diagnosis::images
