// The touches that the model predicts worst.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::residuals {

struct WorstTouch {
  uint64_t touch = 0;  // its number in the measurement file
  std::string object;
  std::vector<double> residual_s;  // [finger], measured minus simulated; NaN: not compared
  double norm_s = 0;               // Euclidean norm of the residuals that are not NaN
};

// At most ten of the touches that count, largest norm first. residuals: [k * fingers + finger], seconds.
std::vector<WorstTouch> FindWorstTouches(const touches::Observations& observations,
                                         const std::vector<double>& residuals);

}  // namespace touchstone::diagnosis::residuals
