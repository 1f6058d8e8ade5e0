// What kind of noise the residuals have: how large, whether it grows with a covariate, whether its tails are heavy,
// whether times sit on the ticks of a polling loop, whether readings are missing. Judged by the likelihood of what
// the best explanation leaves, not by means.
#pragma once

#include <vector>

#include "server/diagnosis/inference/noise_likelihood.h"

namespace touchstone::diagnosis::inference {

// Readings of one sensor that should have been alike.
struct RepeatedReading {
  double expected = 0, silent = 0;  // counts
  bool AlwaysSilent() const { return expected > 1 && silent == expected; }
};

// What the noise is found in.
struct NoiseSample {
  std::vector<ReadingGroup> groups;       // residuals, less any smooth error
  std::vector<double> delays_s;           // readings after the first of their group, s, as they were recorded
  std::vector<RepeatedReading> repeated;  // which of the expected readings are missing
  int size = 0;                           // one more than the largest index that a group may have
};

struct NoiseEstimate {
  double value = 0;
  double std_error = 0;
  double gain_nats = 0;  // over the simpler kind of noise; 0: not claimed
};

struct NoiseFindings {
  NoiseEstimate sigma_s;             // of the noise of one reading (scale, where tails are heavy)
  NoiseEstimate slope;               // growth: EffectRole::kNoiseGrowth
  NoiseEstimate degrees_of_freedom;  // EffectRole::kNoiseTails
  NoiseEstimate poll_interval_s;     // EffectRole::kQuantisation
  NoiseEstimate missed_probability;  // EffectRole::kDropout
  std::vector<int> outliers;         // indices of groups with a reading that no noise of the others explains
  std::vector<double> weights;       // by index: what a group should count for in a fit; empty: all the same
};

// `effective_dof`: degrees of freedom that the fit and the smooth error have used up. Large sets are thinned.
NoiseFindings FindNoise(const NoiseSample& sample, double effective_dof);

}  // namespace touchstone::diagnosis::inference
