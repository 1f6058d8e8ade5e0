// What a diagnosis says in sentences.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// "radius_mm 1.5 +- 0.005 mm, ..."; only how many where they are many.
std::string ValuesInWords(const std::vector<engine::ParameterEstimate>& parameters);

// What limits the diagnosis: few objects, no repeats, few touches.
std::vector<std::string> DataWarnings(const touches::DataSummary& data);

// One paragraph: how wrong, why, what to do. `others_in_place`: effects that were found elsewhere are in the model already.
std::string Summarize(const Diagnosis& diagnosis, bool others_in_place = false);

}  // namespace touchstone::diagnosis::report
