// How wrong is a model, where, why, and what to do (DESIGN 8 and 9).
//
// The three calls are pure functions of their input: the same input gives the same report, whatever the
// number of threads. They never fail because the data are poor: they say what the data can tell. They fail on
// input that contradicts itself (an object without a mesh, other numbers of fingers).
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone {

// How wrong and where. `verdict` stays unspecified.
absl::StatusOr<v1::Report> Compare(const DiagnosisInput& input, const DiagnosisContext& context);

// Also why, what to add, and what the error becomes.
absl::StatusOr<v1::Report> Diagnose(const DiagnosisInput& input, const DiagnosisContext& context);

// Diagnose, with `touches` further touches that would tell the explanations that are left apart.
absl::StatusOr<v1::Report> Propose(const DiagnosisInput& input, int touches, const DiagnosisContext& context);

}  // namespace touchstone
