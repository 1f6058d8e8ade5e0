#include "server/diagnosis/inference/noise_kinds.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/diagnosis/inference/noise_likelihood.h"

namespace touchstone::diagnosis::inference {
namespace {

constexpr int kMaxGroups = 1500;            // that a shape is judged on
constexpr double kEnterNats = 10;           // gain in log likelihood that a further noise parameter needs
constexpr double kKurtosisSigmas = 4;       // of the sample's excess kurtosis before tails are looked at
constexpr double kTickTolerance = 1.01e-6;  // s: files keep whole microseconds
constexpr double kMinTick = 20e-6;          // s
constexpr double kMaxSlope = 10;

// The maximum of f on [low, high] by golden section.
double Maximise(const std::function<double(double)>& f, double low, double high, int steps, double* max) {
  const double golden = 0.5 * (std::sqrt(5.0) - 1);
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double fa = f(a), fb = f(b);
  for (int step = 0; step < steps; ++step) {
    if (fa > fb)
      high = b, b = a, fb = fa, a = high - golden * (high - low), fa = f(a);
    else
      low = a, a = b, fa = fb, b = low + golden * (high - low), fb = f(b);
  }
  *max = std::max(fa, fb);
  return fa > fb ? a : b;
}

// Standard error from the curvature of a log likelihood at its maximum.
double CurvatureError(const std::function<double(double)>& f, double at, double step) {
  const double bend = f(at + step) + f(at - step) - 2 * f(at);
  return bend < 0 ? step / std::sqrt(-bend) : 0;
}

std::vector<ReadingGroup> Thinned(const std::vector<ReadingGroup>& all) {
  if (static_cast<int>(all.size()) <= kMaxGroups) return all;
  std::vector<ReadingGroup> part;
  for (int j = 0; j < kMaxGroups; ++j) part.push_back(all[all.size() * j / kMaxGroups]);
  return part;
}

// Excess kurtosis of residuals in units of their own scale.
bool TailsLookHeavy(const std::vector<ReadingGroup>& groups, const NoiseModel& model) {
  double second = 0, fourth = 0, count = 0;
  for (const ReadingGroup& group : groups) {
    const double n = static_cast<double>(group.residual_s.size());
    for (size_t i = 0; i < group.residual_s.size(); ++i) {
      const double x = group.residual_s[i] / std::sqrt(1 - 1 / n) / (1 + model.slope * group.growth[i]);
      second += x * x, fourth += x * x * x * x, count += 1;
    }
  }
  if (count < 20 || second <= 0) return false;
  return fourth * count / (second * second) - 3 > kKurtosisSigmas * std::sqrt(24 / count);
}

// Times of a polling loop differ by whole multiples of its interval: the interval that `differences` (sorted) fit,
// near `interval`; 0 if they do not.
double RefinedTick(const std::vector<double>& differences, double interval) {
  // Refined over ever larger differences, so that the count of ticks stays certain.
  for (size_t known = 1; known < differences.size(); known *= 2) {
    double sum_nd = 0, sum_nn = 0;
    for (size_t j = 0; j < std::min(2 * known, differences.size()); ++j) {
      const double ticks = std::round(differences[j] / interval);
      sum_nd += ticks * differences[j], sum_nn += ticks * ticks;
    }
    if (!(sum_nn > 0)) return 0;
    interval = sum_nd / sum_nn;
  }
  size_t on_tick = 0;
  for (const double difference : differences)
    on_tick += std::abs(difference - std::round(difference / interval) * interval) <= kTickTolerance;
  return on_tick < 0.99 * differences.size() ? 0 : interval;
}

NoiseEstimate FindPolling(std::vector<double> differences) {
  NoiseEstimate found;
  if (differences.size() < 20) return found;
  std::sort(differences.begin(), differences.end());
  // The smallest step between different values is the interval, or a small multiple of it.
  double min_gap = differences[0];
  for (size_t j = 1; j < differences.size(); ++j) {
    const double gap = differences[j] - differences[j - 1];
    if (gap > 2 * kTickTolerance) min_gap = std::min(min_gap, gap);
  }
  for (int divisor = 1; divisor <= 3; ++divisor) {
    if (min_gap / divisor < kMinTick) break;
    const double interval = RefinedTick(differences, min_gap / divisor);
    if (interval == 0) continue;
    found.value = interval;
    found.std_error =
        0.5e-6 / std::sqrt(static_cast<double>(differences.size())) * interval / differences.back();
    found.std_error = std::max(found.std_error, 1e-9);
    // Each difference would fall on a tick by chance with this probability.
    found.gain_nats = differences.size() * std::log(interval / (2 * kTickTolerance));
    return found;
  }
  return found;
}

// A sensor that is silent in every repeat is out of reach there (the stroke ended, a finger cannot meet the object);
// that is no chance, unless chance alone would bring about as many such groups.
NoiseEstimate FindMissed(const std::vector<RepeatedReading>& repeated) {
  double silent = 0, all = 0, always = 0;
  for (const RepeatedReading& reading : repeated) {
    always += reading.AlwaysSilent();
    if (!reading.AlwaysSilent()) silent += reading.silent, all += reading.expected;
  }
  const double sometimes = all > 0 ? silent / all : 0;
  double by_chance = 0;
  for (const RepeatedReading& reading : repeated)
    if (reading.expected > 1) by_chance += std::pow(sometimes, reading.expected);
  if (always <= by_chance + 3 * std::sqrt(by_chance) + 0.5)
    for (const RepeatedReading& reading : repeated)
      if (reading.AlwaysSilent()) silent += reading.silent, all += reading.expected;

  NoiseEstimate found;
  if (silent < 3 || silent < 0.002 * all) return found;
  found.value = silent / all;
  found.std_error = std::sqrt(found.value * (1 - found.value) / all);
  found.gain_nats = silent * std::log(1 / 1e-4);
  return found;
}

// The kind of noise that residuals have, from the simplest on: each further parameter must earn its likelihood.
class NoiseSearch {
 public:
  NoiseSearch(const std::vector<ReadingGroup>& all, NoiseFindings* found)
      : all_(all), groups_(Thinned(all)), found_(found) {
    best_log_ = ProfileSigma(groups_, &best_);
  }

  const NoiseModel& best() const { return best_; }

  // Does it grow with the covariate?
  void TryGrowth() {
    double log_likelihood = -INFINITY;
    NoiseModel sloped = best_;
    const NoiseModel from = best_;
    const auto at = [&](double log_slope) {
      sloped.slope = std::exp(log_slope);
      sloped.sigma_s = from.sigma_s;
      return ProfileSigma(groups_, &sloped);
    };
    at(Maximise(at, std::log(0.02), std::log(kMaxSlope), 20, &log_likelihood));
    slope_gain_ = log_likelihood - best_log_;
    if (slope_gain_ >= kEnterNats) best_ = sloped, best_log_ = log_likelihood;
  }

  // Heavy tails, or a few outliers among Gaussian noise?
  void TryTails() {
    if (!TailsLookHeavy(groups_, best_)) return;
    const double before = best_log_;
    const StudentFit student = FitStudent(best_);
    NoiseModel mixture;
    const double mixture_log = FitMixture(&mixture);
    if (student.log_likelihood - before >= kEnterNats && student.log_likelihood >= mixture_log - 3) {
      found_->degrees_of_freedom = {student.model.degrees_of_freedom, student.std_error,
                                    student.log_likelihood - before};
      best_ = student.model, best_log_ = student.log_likelihood;
    } else if (mixture_log - before >= kEnterNats) {
      for (const ReadingGroup& group : all_)
        if (OutlierProbability(group, mixture) > 0.5) found_->outliers.push_back(group.index);
      best_ = mixture, best_log_ = mixture_log;
    }
    if (slope_gain_ >= kEnterNats && best_.shape != NoiseShape::kGaussian) DropSlopeThatTailsExplain();
  }

  void DescribeGrowth() {
    if (slope_gain_ < kEnterNats) return;
    NoiseModel at = best_;
    const auto by_slope = [&](double slope) {
      at.slope = slope;
      at.sigma_s = best_.sigma_s;
      return ProfileSigma(groups_, &at);
    };
    found_->slope = {best_.slope, CurvatureError(by_slope, best_.slope, 0.05 * best_.slope), slope_gain_};
  }

 private:
  struct StudentFit {
    NoiseModel model;
    double log_likelihood = -INFINITY;
    double std_error = 0;  // of the degrees of freedom
  };
  StudentFit FitStudent(const NoiseModel& from) const {
    StudentFit fit;
    fit.model = from;
    fit.model.shape = NoiseShape::kStudent;
    const auto at = [&](double log_dof) {
      fit.model.degrees_of_freedom = std::exp(log_dof);
      fit.model.sigma_s = from.sigma_s;
      return ProfileSigma(groups_, &fit.model);
    };
    const double log_dof = Maximise(at, std::log(1.2), std::log(60.0), 9, &fit.log_likelihood);
    const double relative_error = CurvatureError(at, log_dof, 0.1);
    at(log_dof);
    fit.std_error = fit.model.degrees_of_freedom * relative_error;
    return fit;
  }

  // The best mixture of noise and outliers on a grid; returns its log likelihood.
  double FitMixture(NoiseModel* mixture) const {
    double best = -INFINITY;
    for (const double width : {6.0, 15.0, 40.0, 100.0})
      for (const double share : {0.002, 0.007, 0.02, 0.05}) {
        NoiseModel at = best_;
        at.shape = NoiseShape::kMixture;
        at.width = width, at.share = share;
        const double value = ProfileSigma(groups_, &at);
        if (value > best) best = value, *mixture = at;
      }
    return best;
  }

  // Tails may have looked like a slope.
  void DropSlopeThatTailsExplain() {
    NoiseModel level = best_;
    level.slope = 0;
    slope_gain_ = best_log_ - ProfileSigma(groups_, &level);
    if (slope_gain_ >= kEnterNats) return;
    best_ = level;
    if (best_.shape != NoiseShape::kStudent) return;
    const StudentFit student = FitStudent(level);
    found_->degrees_of_freedom.value = student.model.degrees_of_freedom;
    found_->degrees_of_freedom.std_error = student.std_error;
    best_ = student.model;
  }

  const std::vector<ReadingGroup>& all_;
  std::vector<ReadingGroup> groups_;
  NoiseFindings* found_;
  NoiseModel best_;
  double best_log_ = 0;
  double slope_gain_ = 0;
};

// What a group should count for where the noise is not the same everywhere.
std::vector<double> WeightsOf(const std::vector<ReadingGroup>& all, const NoiseModel& model,
                              double degrees_of_freedom, int size) {
  std::vector<double> weights(size, 1.0);
  for (const ReadingGroup& group : all) {
    double squares = 0, variance = 0;
    const double n = static_cast<double>(group.residual_s.size());
    for (size_t i = 0; i < group.residual_s.size(); ++i) {
      const double s = model.sigma_s * (1 + model.slope * group.growth[i]);
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

NoiseFindings FindNoise(const NoiseSample& sample, double effective_dof) {
  NoiseFindings found;
  found.poll_interval_s = FindPolling(sample.delays_s);
  found.missed_probability = FindMissed(sample.repeated);
  if (sample.groups.empty()) return found;
  NoiseSearch search(sample.groups, &found);
  search.TryGrowth();
  search.TryTails();
  search.DescribeGrowth();

  // What the fit has followed of the noise is given back.
  NoiseModel best = search.best();
  double degrees_of_freedom = 0;
  for (const ReadingGroup& group : sample.groups)
    degrees_of_freedom += static_cast<double>(group.residual_s.size()) - 1;
  const double left = std::max(degrees_of_freedom - effective_dof, 1.0);
  best.sigma_s *= std::sqrt(degrees_of_freedom / left);
  found.sigma_s = {best.sigma_s, best.sigma_s / std::sqrt(2 * left), 0};
  // Slope and tails share what is known of the scale.
  if (found.slope.gain_nats > 0) found.sigma_s.std_error *= 2;
  if (found.degrees_of_freedom.gain_nats > 0) found.sigma_s.std_error *= 1.6;

  // Polling adds the scatter of the ticks.
  if (found.poll_interval_s.gain_nats > 0) {
    const double tick = found.poll_interval_s.value;
    const double variance = best.sigma_s * best.sigma_s - tick * tick / 12;
    found.sigma_s.value = variance > 0 ? std::sqrt(variance) : 0;
    if (found.sigma_s.value < 0.1 * tick) found.sigma_s.value = 0;
  }
  const bool heavy_tails = found.degrees_of_freedom.gain_nats > 0;
  if (heavy_tails || found.slope.gain_nats > 0)
    found.weights =
        WeightsOf(sample.groups, best, heavy_tails ? best.degrees_of_freedom : INFINITY, sample.size);
  return found;
}

}  // namespace touchstone::diagnosis::inference
