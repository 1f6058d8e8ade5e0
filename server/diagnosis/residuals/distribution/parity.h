// Measured over simulated times, for a plot of one against the other.
#pragma once

#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

// One finger of one touch. Times are less the mean over the touch's compared fingers: only differences
// between fingers are measured.
struct ParityPoint {
  double simulated_s = 0;  // by the initial model
  double measured_s = 0;
  double improved_s = 0;  // by the improved model; the measured time where that model misses
  int finger = 0;         // 0 is the first
};

// At most 2,000 points, evenly spread over the session. `before` and `after` are the residuals of the initial
// and the improved model, [k * fingers + finger], seconds, NaN where a finger takes no part.
std::vector<ParityPoint> MakeParity(const touches::Observations& observations,
                                    const touches::Prediction& initial, const std::vector<double>& before,
                                    const std::vector<double>& after);

}  // namespace touchstone::diagnosis::residuals
