#include "server/diagnosis/touches/noise/noise_kinds.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/diagnosis/touches/noise/noise_search.h"
#include "server/diagnosis/touches/noise/rules.h"
#include "server/diagnosis/touches/noise/ticks.h"

namespace touchstone::diagnosis::touches {
namespace {

NoiseEstimate FindPolling(std::vector<double> differences, const std::optional<double>& declared_s) {
  NoiseEstimate found;
  if (differences.size() < kNoiseRules.min_delays) return found;
  std::sort(differences.begin(), differences.end());
  double interval = FindTick(differences);
  if (interval == 0 && declared_s && *declared_s >= kNoiseRules.min_tick) {
    interval = RefinedTick(differences, *declared_s);
    found.absent = interval == 0;
  }
  if (interval == 0) return found;
  found.value = interval;
  found.std_error =
      0.5e-6 / std::sqrt(static_cast<double>(differences.size())) * interval / differences.back();
  found.std_error = std::max(found.std_error, 1e-9);
  // Each difference would fall on a tick by chance with this probability.
  found.gain_nats = differences.size() * std::log(interval / (2 * kNoiseRules.tick_tolerance));
  return found;
}

// The probability of silence from sensors that were silent in some of their repeats and not in all: what was silent
// in all of them may be out of reach, and leaving it out must not make silence look rarer than it is. The root of
//   silent = sum over readings of m p (1 - p^(m-1)) / (1 - p^m),  m: how often a reading was expected
double SilenceAmongRepeats(const std::vector<RepeatedReading>& repeated) {
  double silent = 0;
  std::map<double, int> by_expected;
  for (const RepeatedReading& reading : repeated) {
    if (reading.AlwaysSilent() || reading.expected < 2) continue;
    silent += reading.silent;
    ++by_expected[reading.expected];
  }
  if (silent == 0) return 0;
  double low = 0, high = 1 - 1e-9;
  for (int step = 0; step < 60; ++step) {
    const double p = 0.5 * (low + high);
    double mean = 0;
    for (const auto& [m, readings] : by_expected)
      mean += readings * m * p * (1 - std::pow(p, m - 1)) / (1 - std::pow(p, m));
    (mean < silent ? low : high) = p;
  }
  return 0.5 * (low + high);
}

// Log likelihood of counts, less a constant.
double SilenceLog(double silent, double all, double p) {
  const double reported = all - silent;
  return (silent > 0 ? silent * std::log(p) : 0) + (reported > 0 ? reported * std::log1p(-p) : 0);
}

// A sensor that is silent in every repeat is out of reach there (the stroke ended, a finger cannot meet the object);
// that is no chance, unless chance alone would bring about as many such groups.
NoiseEstimate FindMissed(const std::vector<RepeatedReading>& repeated,
                         const std::optional<double>& declared) {
  double silent = 0, all = 0, always = 0, by_chance = 0;
  const double among_repeats = SilenceAmongRepeats(repeated);
  for (const RepeatedReading& reading : repeated) {
    always += reading.AlwaysSilent();
    if (reading.expected > 1) by_chance += std::pow(among_repeats, reading.expected);
    if (!reading.AlwaysSilent()) silent += reading.silent, all += reading.expected;
  }
  const bool chance = always <= by_chance + 3 * std::sqrt(by_chance) + 0.5;
  if (chance)
    for (const RepeatedReading& reading : repeated)
      if (reading.AlwaysSilent()) silent += reading.silent, all += reading.expected;

  NoiseEstimate found;
  if (all == 0) return found;
  found.value = chance || among_repeats == 0 ? silent / all : among_repeats;
  const bool rare = silent < 3 || silent < kNoiseRules.min_missed * all;
  if (rare && declared && *declared > 0 && *declared < 1)
    found.absent = SilenceLog(silent, all, found.value) - SilenceLog(silent, all, *declared) >=
                   kNoiseRules.declared_excluded;
  if (rare) return found;
  found.std_error = std::sqrt(found.value * (1 - found.value) / all);
  found.gain_nats = silent * std::log(1 / 1e-4);
  return found;
}

// What a group should count for where the noise is not the same everywhere.
std::vector<double> WeightsOf(const std::vector<ReadingGroup>& all, const NoiseModel& model,
                              double degrees_of_freedom, int size) {
  std::vector<double> weights(size, 1.0);
  for (const ReadingGroup& group : all) {
    double squares = 0, variance = 0;
    const double n = static_cast<double>(group.residual_s.size());
    for (size_t i = 0; i < group.residual_s.size(); ++i) {
      const double s = model.sigma_s * RelativeScale(group, i, model);
      squares += group.residual_s[i] * group.residual_s[i] / (s * s);
      variance += s * s / n;
    }
    double weight = model.sigma_s * model.sigma_s / variance;
    if (std::isfinite(degrees_of_freedom))
      weight *= (degrees_of_freedom + n - 1) / (degrees_of_freedom + squares);
    weights[group.index] = weight;
  }
  return weights;
}

}  // namespace

NoiseFindings FindNoise(const NoiseSample& sample, double effective_dof, const DeclaredNoise& declared) {
  NoiseFindings found;
  found.poll_interval_s = FindPolling(sample.delays_s, declared.poll_interval_s);
  found.missed_probability = FindMissed(sample.repeated, declared.missed_probability);
  if (sample.groups.empty()) return found;
  NoiseSearch search(sample, declared, &found);
  search.Run();
  found.model = search.best();

  // What the fit has followed of the noise is given back.
  double degrees_of_freedom = 0;
  for (const ReadingGroup& group : sample.groups)
    degrees_of_freedom += static_cast<double>(group.residual_s.size()) - 1;
  const double given_back = std::sqrt(degrees_of_freedom / std::max(degrees_of_freedom - effective_dof, 1.0));
  NoiseModel best = search.best();
  best.sigma_s *= given_back;
  for (NoiseEstimate* estimate : {&found.sigma_s, &found.length_sigma_m})
    estimate->value *= given_back, estimate->std_error *= given_back;
  for (NoiseEstimate& estimate : found.channel_sigma_s)
    estimate.value *= given_back, estimate.std_error *= given_back;

  // Polling adds the scatter of the ticks.
  if (found.poll_interval_s.gain_nats > 0) {
    const double tick = found.poll_interval_s.value;
    found.shape_hidden =
        tick * tick / 12 > kNoiseRules.hidden_share * found.sigma_s.value * found.sigma_s.value;
    if (found.shape_hidden) {
      for (NoiseEstimate* kind : {&found.slope, &found.degrees_of_freedom, &found.length_sigma_m})
        kind->absent = false;
      found.channels_absent = false;
    }
    const double variance = found.sigma_s.value * found.sigma_s.value - tick * tick / 12;
    found.sigma_s.value = variance > 0 ? std::sqrt(variance) : 0;
    if (found.sigma_s.value < 0.1 * tick) found.sigma_s.value = 0;
  }
  const bool heavy_tails = found.degrees_of_freedom.gain_nats > 0;
  if (heavy_tails || found.slope.gain_nats > 0 || found.length_sigma_m.gain_nats > 0)
    found.weights =
        WeightsOf(sample.groups, best, heavy_tails ? best.degrees_of_freedom : INFINITY, sample.size);
  return found;
}

}  // namespace touchstone::diagnosis::touches
