// What a diagnosis says in sentences.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// What limits the diagnosis: few objects, no repeats, few touches.
// "radius_mm 1.5 +- 0.005 mm, ..."; only how many where they are many.
std::string ValuesInWords(const std::vector<inference::ParameterEstimate>& parameters);

std::vector<std::string> DataWarnings(const touches::DataSummary& data);

// One paragraph: how wrong, why, what to do.
std::string Summarize(const Diagnosis& diagnosis);

}  // namespace touchstone::diagnosis::report
