// What descriptions of residuals need to know besides the residuals.
#pragma once

#include <cstdint>

namespace touchstone::diagnosis::residuals {

struct ResidualScale {
  double sigma_s = 0;        // noise of one finger's time
  double spacing_m = 0.030;  // between fingers, for the local curvature
  uint64_t seed = 0;         // of permutations and of the noise that is added to simulated times
};

}  // namespace touchstone::diagnosis::residuals
