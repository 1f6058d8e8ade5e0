// What the engine needs of a set of touches to find the kind of its noise.
#pragma once

#include <vector>

#include "server/diagnosis/touches/noise/noise_kinds.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::touches {

// Whether the model expects each finger to report: it meets the object, no farther than the farthest that reported
// (beyond it is the end of the rig's stroke). `prediction` with details. [k * fingers + i]
std::vector<char> ExpectedReadings(const Observations& observations, const Prediction& prediction);

// Tangents of the incidence. [k * fingers + i]
std::vector<double> TangentsOfIncidence(const Prediction& prediction);

// residuals_s: what is left, less any surface error; tan_incidence: of every finger; both [k * fingers + i], NaN
// where a finger takes no part. expected: whether the model expects the finger to report. Only touches that are
// used count. Groups carry the touch as their index.
NoiseSample MakeNoiseSample(const Observations& observations, const std::vector<double>& residuals_s,
                            const std::vector<double>& tan_incidence, const std::vector<char>& expected);
// The same of residuals of one model, `prediction` with its details.
NoiseSample MakeNoiseSample(const Observations& observations, const std::vector<double>& residuals_s,
                            const Prediction& prediction);

}  // namespace touchstone::diagnosis::touches
