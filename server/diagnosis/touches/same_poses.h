// Two sets of touches on the poses that both made: whether contact times differ by more than noise, pose by pose.
#pragma once

#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::touches {

// A set with what a model leaves of it.
struct PosedResiduals {
  const Observations* observations = nullptr;
  const std::vector<double>* residuals_s = nullptr;  // of Residuals (prediction.h), [k * fingers + i]
  double sigma_s = 0;                                // noise of one finger's time, > 0
  double degrees_of_freedom = 0;                     // from which it is known, > 0
};

struct SamePoses {
  int poses = 0;  // that both sets touched with every finger
  // Root mean square of the differences of one finger's mean at one pose, what the noise of both lets expect, and P of at
  // least as much by chance.
  double rms_s = 0, expected_s = 0;
  double p = 1;
};

// Poses are the same where object and commanded touch are equal, number by number. Residuals under one model compare what was
// measured; residuals under a model for each set, what these leave. Sets with other numbers of fingers share no pose.
SamePoses CompareSamePoses(const PosedResiduals& one, const PosedResiduals& other);

}  // namespace touchstone::diagnosis::touches
