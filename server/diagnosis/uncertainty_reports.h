// How well a fitted model predicts touches: of a diagnosis, those of its own set; else those of a plan.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/touches/predictor.h"

namespace touchstone::diagnosis {

// Budgets, and the uncertainty at each of data[0]'s points on the surfaces. `prediction`: of the posterior's
// model, with details. Where data[0] has the errors of that model, what it leaves of them beyond noise and surfaces is the
// contribution "misfit", the same for every object and in no point's uncertainty. Values at a bound of their range, which no
// contribution has, are warnings.
absl::Status AddUncertainty(const touches::Predictor& predictor, const touches::Prediction& prediction,
                            const uncertainty::Posterior& posterior, report::Diagnosis* diagnosis);

// See Uncertainty (diagnose.h).
absl::StatusOr<report::Diagnosis> UncertaintyOfPlan(const DiagnosisInput& input,
                                                    const uncertainty::Posterior& posterior,
                                                    const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
