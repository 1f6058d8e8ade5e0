// What is told beside a diagnosis: what could be found, why one effect, two models.
#pragma once

#include "server/diagnosis/report/diagnosis.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

void WriteDetectable(const engine::DetectableValue& value, v1::DetectableEffect* message);
// `fingers`: names, as DataReport has them.
void WriteExplanation(const ReportedExplanation& explained, const std::vector<std::string>& fingers,
                      v1::ExplainedEffect* message);
void WriteVersus(const Versus& versus, const std::vector<std::string>& fingers, v1::ModelComparison* message);

}  // namespace touchstone::diagnosis::report
