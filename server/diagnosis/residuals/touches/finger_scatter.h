// Whether one finger's residuals differ in size from the others', though a model with one noise for all fingers says
// that they do not.
#pragma once

#include <optional>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::residuals {

struct FingerScatter {
  int finger = 0;
  double rmse_s = 0, others_rmse_s = 0;  // per degree of freedom, as of groups
  double p_value = 1;                    // paid for every finger
};

// The finger that differs most from the mean of the others, if by more than a sixth of their error and by no chance
// (p < 1e-3). Assessed by differences of squares within touches, summed by pose or by
// stretches of the session, whichever scatter more: heavy tails, repeats that share an error and correlated noise alarm no more
// often. Nothing of one or two fingers, whose residuals are of equal size in every touch.
std::optional<FingerScatter> FindFingerScatter(const touches::Observations& observations,
                                               const std::vector<double>& residuals);

}  // namespace touchstone::diagnosis::residuals
