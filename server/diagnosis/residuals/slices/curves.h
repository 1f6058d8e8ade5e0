// Residual against every covariate: a curve per finger, and whether the residual depends on the covariate at
// all.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

struct ResidualCurveBin {
  int finger = 0;              // 0 is the first
  int touches = 0;             // in the bin
  double centre = 0;           // mean of the covariate, in the curve's unit
  double mean_residual_s = 0;  // of the initial model; measured minus simulated
  double std_error_s = 0;      // of that mean, with poses as independent units; 0: fewer than two poses
  double improved_mean_residual_s = 0;  // of the improved model
};

// Whether one finger alone depends on the place in the session, before and after the steps.
struct FingerDependence {
  int finger = 0;
  double p_value = 1, improved_p_value = 1;  // like those of the curve, times the number of fingers
};

struct ResidualCurve {
  std::string covariate;  // "incidence_deg"
  std::string unit;       // of the covariate: "deg"; empty for ratios and categories
  std::vector<ResidualCurveBin>
      bins;  // finger by finger, in the order of the covariate; empty if it cannot be cut
  // Probability of a dependence at least this strong if there were none: permutation of poses (or of the
  // touches of a pose, where the covariate varies among them), times the number of curves.
  double p_value = 1;
  double improved_p_value = 1;            // the same of what the improved model leaves
  std::vector<FingerDependence> fingers;  // of session_time_s and touch_number; else empty
};

// A curve for every covariate but the finger, and for the touch's number in the order of the session. `before` and `after` are the residuals of the initial and the
// improved model, [k * fingers + finger], seconds, NaN where a finger takes no part. `seed` is that of the
// permutations. Reads at most 60,000 touches, the permutations at most 20,000 poses. Deterministic.
std::vector<ResidualCurve> MakeResidualCurves(const touches::Observations& observations,
                                              const touches::Prediction& initial,
                                              const std::vector<double>& before,
                                              const std::vector<double>& after, uint64_t seed);

}  // namespace touchstone::diagnosis::residuals
