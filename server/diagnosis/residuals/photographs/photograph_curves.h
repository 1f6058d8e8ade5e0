// The residual of photographs against every covariate.
#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/images/photographs.h"
#include "server/diagnosis/residuals/slices/covariates.h"

namespace touchstone::diagnosis::residuals {

// One curve for each numeric covariate, in their order. `after` empty: the given model alone.
std::vector<images::PhotographCurve> PhotographCurves(const images::Photographs& photographs,
                                                      const std::vector<image::Photo>& before,
                                                      const std::vector<image::Photo>& after,
                                                      const std::vector<ResidualCovariate>& covariates,
                                                      uint64_t seed, ThreadPool* pool);

}  // namespace touchstone::diagnosis::residuals
