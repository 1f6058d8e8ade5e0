// How wrong is a model, where, why, and what to do. Residuals are measured minus simulated for the same commanded
// touch, differences between fingers only; the noise floor is the error that repeats have among themselves.
//
// The three calls are pure functions of their input: the same input gives the same result, durations aside, whatever
// the number of threads. They never fail because the data are poor: they say what the data can tell. They fail on
// input that contradicts itself (an object without a mesh, other numbers of fingers).
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

// How wrong and where. The verdict is kNone.
absl::StatusOr<report::Diagnosis> Compare(const DiagnosisInput& input, const DiagnosisContext& context);

// Also why, what to add, and what the error becomes.
absl::StatusOr<report::Diagnosis> Diagnose(const DiagnosisInput& input, const DiagnosisContext& context);

// Diagnose, with at most `max_touches` further touches that would tell the explanations that are left apart, or
// improve the values where only one is left.
absl::StatusOr<report::Diagnosis> Propose(const DiagnosisInput& input, int max_touches,
                                          const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
