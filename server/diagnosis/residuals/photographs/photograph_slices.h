// Parts of the pictures in which the model is wrong, as slices.h finds them among touches.
#pragma once

#include <vector>

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/images/photographs.h"
#include "server/diagnosis/residuals/slices/covariates.h"

namespace touchstone::diagnosis::residuals {

// At most five, largest share of the excess error first; slices may overlap. `sigma_grey`: the noise floor.
std::vector<images::PhotographSlice> FindPhotographSlices(const images::Photographs& photographs,
                                                          const std::vector<image::Photo>& expected,
                                                          const std::vector<ResidualCovariate>& covariates,
                                                          double sigma_grey);

}  // namespace touchstone::diagnosis::residuals
