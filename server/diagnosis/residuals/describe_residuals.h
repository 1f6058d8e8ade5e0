// What the pictures of a report show: errors by group, residuals over covariates, histograms, parity, points
// on the surfaces (DESIGN 8 and 9).
#pragma once

#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone {

struct ResidualScale {
  double sigma_s = 0;        // of one finger's time
  double spacing_m = 0.030;  // between fingers, for the local curvature
  uint64_t seed = 0;         // of permutations and of the noise that is added to simulated times
};

// Fills groups, worst_touches, finger_bias_us, curves, histograms, parity, surface_points and outlines.
// `before` and `after` are the residuals of the predictions `initial` and `improved`, which may be the same.
// Deterministic. Permutations read at most 20,000 poses' worth of touches, curves at most 60,000 touches;
// everything else reads all.
void DescribeResiduals(const Observations& observations, const Prediction& initial,
                       const Prediction& improved, const std::vector<double>& before,
                       const std::vector<double>& after, const ResidualScale& scale, v1::Report* report);

// Its parts, a file each.
void DescribeGroups(const Observations& observations, const std::vector<double>& residuals, double sigma_s,
                    v1::Report* report);  // groups.cpp: also worst touches and bias
void DescribeCurves(const Observations& observations, const Prediction& initial,
                    const std::vector<double>& before, const std::vector<double>& after, uint64_t seed,
                    v1::Report* report);  // curves.cpp
void DescribeHistograms(const Observations& observations, const Prediction& initial,
                        const Prediction& improved, const ResidualScale& scale,
                        v1::Report* report);  // histograms.cpp

}  // namespace touchstone
