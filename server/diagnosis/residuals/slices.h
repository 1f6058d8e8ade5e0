// Where the model is wrong: parts of the data that a person can picture (DESIGN 9, `where`).
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone {

// At most six slices, each one or two conditions ("incidence > 12 deg and finger = r"), that hold more of the
// excess error than their size, or a bias of their own. Excess is the sum of squared residuals less what
// noise of sigma_s gives. Each slice was chosen for excess that those before it do not hold; they may
// overlap.
//
// Thresholds are found on half of the poses and kept only if the other half agrees; then the numbers are
// computed from all touches. Empty if nothing stands out. The search reads at most 30,000 touches (whole
// poses, spread over the set).
std::vector<v1::Slice> FindSlices(const Observations& observations, const Prediction& prediction,
                                  const std::vector<double>& residuals, double sigma_s);

// "9.1 ms", "410 us", "1.25 s": three figures at the most, for people.
std::string TimeInWords(double time_s);

}  // namespace touchstone
