// What the residuals of photographs depend on, whatever the cause: radius, row, column, grey level, incidence, depth,
// session time.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

struct PhotoCovariate {
  std::string name;  // as formulas and lookups name it
  double p =
      1;  // of the largest deviation of a bin if nothing depended on it, corrected for all bins and covariates
  double gain_nats = 0;
  double unseen_gain =
      0;  // share of the mean square residual that the curve takes from pictures it did not see
  std::vector<double> knots, mean_grey;  // of the bins
};

// Largest gain first. The scatter between poses judges, not that between pixels: what one picture has may be anything.
std::vector<PhotoCovariate> TestCovariates(const Photographs& photographs,
                                           const std::vector<image::Photo>& expected);

}  // namespace touchstone::diagnosis::images
