// Where the model is wrong: parts of the data that a person can picture.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

// A part of the data in which the model is wrong, described by one or two conditions. It consists of single
// fingers of touches; a residual is measured minus simulated time, less its mean over the touch's fingers.
struct ErrorSlice {
  std::string conditions;            // "incidence > 12 deg and finger = r"
  std::string words;                 // what is wrong there: "contact too early by 9.1 ms"
  int touches = 0;                   // with at least one finger in the slice
  double mean_residual_s = 0;        // over the slice's fingers
  double rmse_s = 0;                 // root of their mean square residual
  double share_of_excess_error = 0;  // of the whole set's excess error, 0 to 1
  std::vector<char> cells;           // [k * fingers + finger]: whether it is in the slice
};

// At most six slices that hold more of the excess error than their size, or a bias of their own, largest
// share first. Excess error is the sum of squared residuals less what noise of sigma_s contributes. Each
// slice was chosen for excess that those found before do not hold; slices may overlap.
//
// residuals: [k * fingers + finger], seconds, NaN where a finger takes no part. Thresholds are found on half
// of the poses and kept only if the other half agrees; the numbers are then computed from all touches. Empty
// if nothing stands out. The search reads at most 30,000 touches (whole poses, spread over the set).
std::vector<ErrorSlice> FindSlices(const touches::Observations& observations,
                                   const touches::Prediction& prediction,
                                   const std::vector<double>& residuals, double sigma_s);

// The same of what these residuals have beyond those of another model (NaN in the same places): excess error is the sum of
// squared residuals less that of the other's. share_of_excess_error: of the whole set's difference.
std::vector<ErrorSlice> FindSlicesBeyond(const touches::Observations& observations,
                                         const touches::Prediction& prediction,
                                         const std::vector<double>& residuals,
                                         const std::vector<double>& other, double sigma_s);

}  // namespace touchstone::diagnosis::residuals
