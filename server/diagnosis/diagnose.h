// How wrong is a model, where, why, and what to do, whatever was measured: touches, touches without poses, photographs, or
// touches and photographs of one session together. Residuals are measured minus simulated for the same command; the noise
// floor is the error that repeats have among themselves.
//
// The calls are pure functions of their input: the same input gives the same result, durations aside, whatever
// the number of threads. They never fail because the data are poor: they say what the data can tell. They fail on
// input that contradicts itself (an object without a mesh, other numbers of fingers).
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/design/plan_check.h"
#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

// How wrong and where; with a second model, of touches only, which of the two errs less. The verdict is kNone.
absl::StatusOr<report::Diagnosis> Compare(const DiagnosisInput& input, const DiagnosisContext& context);
// The same of several sessions (session_reports.h).
absl::StatusOr<report::Diagnosis> Compare(const std::vector<DiagnosisInput>& sessions,
                                          const DiagnosisContext& context);

// Also why, what to add, and what the error becomes.
absl::StatusOr<report::Diagnosis> Diagnose(const DiagnosisInput& input, const DiagnosisContext& context);
// The same of several sessions, and which values they share: Diagnosis::sessions.
absl::StatusOr<report::Diagnosis> Diagnose(const std::vector<DiagnosisInput>& sessions,
                                           const DiagnosisContext& context);

// Diagnose, with at most `max_measurements` further touches, or pictures, that would tell the explanations that are left
// apart, or improve the values where only one is left. Of touches or of photographs: INVALID_ARGUMENT for both.
absl::StatusOr<report::Diagnosis> Propose(const DiagnosisInput& input, int max_measurements,
                                          const DiagnosisContext& context);

// What a plan of touches would find, before it is made: Diagnosis::detectable, and `next` where touches are asked for. The
// verdict is kNone; times of the set are not read.
absl::StatusOr<report::Diagnosis> Check(const DiagnosisInput& input, const design::PlanQuestion& question,
                                        const DiagnosisContext& context);

// Why one effect (by name) is, or is not, what the model lacks: Diagnosis::explained. The verdict is kNone.
absl::StatusOr<report::Diagnosis> Explain(const DiagnosisInput& input, const std::string& effect,
                                          const DiagnosisContext& context);

// How well a fitted model predicts the touches of a plan, whose times are not read, and whose model is the
// posterior's: Diagnosis::uncertainty, and data[0].surface_points. The verdict is kNone.
absl::StatusOr<report::Diagnosis> Uncertainty(const DiagnosisInput& input,
                                              const uncertainty::Posterior& posterior,
                                              const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
