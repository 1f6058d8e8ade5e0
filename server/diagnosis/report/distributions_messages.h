// The comparison of a set without poses as a wire message, with its sentences.
#pragma once

#include "server/diagnosis/distributions/pose_free.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// The whole report but version and duration. `input` is what was compared.
v1::Report PoseFreeReport(const DiagnosisInput& input, const distributions::PoseFreeComparison& comparison);

}  // namespace touchstone::diagnosis::report
