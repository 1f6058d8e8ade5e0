// What kind of noise the residuals have: how large, whether it grows on slopes, whether its tails are heavy,
// whether times sit on the ticks of a polling loop, whether contacts are missed. Judged by the likelihood of
// what the best explanation leaves, not by means.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone {

struct NoiseEstimate {
  double value = 0;
  double std_error = 0;
  double gain_nats = 0;  // over the simpler kind of noise; 0: not claimed
};

struct NoiseFindings {
  NoiseEstimate sigma_s;             // of the noise on one finger's time (scale, where tails are heavy)
  NoiseEstimate slope;               // incidence_noise
  NoiseEstimate degrees_of_freedom;  // heavy_tail_noise
  NoiseEstimate poll_interval_s;     // poll_interval
  NoiseEstimate missed_probability;  // missed_contact
  std::vector<int> outliers;         // touches with a finger that no noise of the others explains
  std::vector<double> weights;       // a touch: what it should count for in a fit; empty: all the same
};

// residuals: what is left, less any surface error; tan_incidence: of every finger; both [k * fingers + i],
// NaN where a finger takes no part. expected: whether the model expects the finger to report. taken: degrees
// of freedom that the fit and the surface error have used up. Only touches that are used count; large sets
// are thinned.
NoiseFindings FindNoise(const Observations& observations, const std::vector<double>& residuals,
                        const std::vector<double>& tan_incidence, const std::vector<char>& expected,
                        double taken);

}  // namespace touchstone
