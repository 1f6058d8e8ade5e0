// How well a fitted model predicts touches: of a diagnosis, those of its own set; else those of a plan.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/touches/predictor.h"

namespace touchstone::diagnosis {

// What the model leaves of these touches beyond the budgets, as their contribution "misfit": of a finger less the mean over its
// touch. Nothing without the errors of that model.
void AddMisfitOfTouches(const report::DataReport& data, std::vector<uncertainty::Budget>* budgets);

// A warning per value of which the data say no more than that it lies at a bound: no standard error is its own.
void WarnOfBounds(const uncertainty::Posterior& posterior, std::vector<std::string>* warnings);

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
