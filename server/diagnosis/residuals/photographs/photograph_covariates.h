// What the residual of a pixel may depend on, in the words and units that people use.
#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnosis/images/photographs.h"
#include "server/diagnosis/residuals/slices/covariates.h"

namespace touchstone::diagnosis::residuals {

// `value(k, pixel)` of photograph k; those that never vary are left out. Names as in image formulas, but for the
// categories part, light_side and object. `expected` must have details, and outlive the list, as must `photographs`.
std::vector<ResidualCovariate> ListPixelCovariates(const images::Photographs& photographs,
                                                   const std::vector<image::Photo>& expected,
                                                   ThreadPool* pool);

// Measured minus expected grey levels of one photograph.
std::vector<float> PixelResiduals(const images::Photographs& photographs,
                                  const std::vector<image::Photo>& expected, int k);

}  // namespace touchstone::diagnosis::residuals
