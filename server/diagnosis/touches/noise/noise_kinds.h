// What kind of noise the residuals have: how large, whether it grows with a covariate or differs between channels,
// whether its tails are heavy, whether times sit on the ticks of a polling loop, whether readings are missing. Judged
// by the likelihood of what the best explanation leaves, not by means. What a model declares is judged with it: it
// stays, has another value, or is absent.
#pragma once

#include <optional>
#include <vector>

#include "server/diagnosis/touches/noise/noise_likelihood.h"

namespace touchstone::diagnosis::touches {

// Readings of one sensor that should have been alike.
struct RepeatedReading {
  double expected = 0, silent = 0;  // counts
  bool AlwaysSilent() const { return expected > 1 && silent == expected; }
};

// What the noise is found in.
struct NoiseSample {
  std::vector<ReadingGroup> groups;   // residuals, less any smooth error
  std::vector<ReadingGroup> repeats;  // the same less the mean over repeats: no misfit, if there are repeats
  std::vector<double> delays_s;       // readings after the first of their group, s, as they were recorded
  std::vector<RepeatedReading> repeated;  // which of the expected readings are missing
  int size = 0;                           // one more than the largest index that a group may have
  int channels = 0;
  double rms_slowness_s_per_m = 0;  // what ReadingGroup::slowness is relative to
};

// What the model that left these residuals says of its noise; nothing: it has no such effect.
struct DeclaredNoise {
  std::optional<double> slope, degrees_of_freedom, poll_interval_s, missed_probability;
  double sigma_s = 0;
  std::optional<double> length_sigma_m;
  std::vector<double> channel_sigma_s;  // beyond sigma_s, in quadrature; empty: no such effect
};

struct NoiseEstimate {
  double value = 0;
  double std_error = 0;
  double gain_nats = 0;  // over the simpler kind of noise; 0: not claimed
  bool absent = false;   // it was declared, its value is ruled out, and the data do without it
};

struct NoiseFindings {
  NoiseEstimate sigma_s;             // of the noise of one reading (scale, where tails are heavy)
  NoiseEstimate slope;               // growth: EffectRole::kNoiseGrowth
  NoiseEstimate degrees_of_freedom;  // EffectRole::kNoiseTails
  NoiseEstimate poll_interval_s;     // EffectRole::kQuantisation
  NoiseEstimate missed_probability;  // EffectRole::kDropout
  NoiseEstimate length_sigma_m;      // of a noise of lengths, beside sigma_s: EffectRole::kNoiseOfLength
  // By channel, s, of what its noise has beyond sigma_s, in quadrature: EffectRole::kNoiseByFinger. Empty: all alike.
  std::vector<NoiseEstimate> channel_sigma_s;
  bool channels_absent = false;
  bool shape_hidden =
      false;         // ticks make so much of the scatter that kinds which a model declares cannot be assessed
  NoiseModel model;  // that describes the residuals best
  std::vector<int> outliers;  // indices of groups with a reading that no noise of the others explains
  // Those of them that are about as far off as the farthest: a fit that has followed one makes its repeats look like others.
  std::vector<int> farthest_outliers;
  std::vector<double> weights;  // by index: what a group should count for in a fit; empty: all the same
};

// `effective_dof`: degrees of freedom that the fit and the smooth error have used up. Every reading counts; only the
// shape of heavy tails is found on a part of a large set.
NoiseFindings FindNoise(const NoiseSample& sample, double effective_dof, const DeclaredNoise& declared = {});

}  // namespace touchstone::diagnosis::touches
