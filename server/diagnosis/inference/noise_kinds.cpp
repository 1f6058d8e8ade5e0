#include "server/diagnosis/inference/noise_kinds.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "server/diagnosis/inference/noise_likelihood.h"

namespace touchstone {
namespace {

constexpr int kMaxTouches = 1500;           // that a shape is judged on
constexpr double kEnterNats = 10;           // gain in log likelihood that a further noise parameter needs
constexpr double kKurtosisSigmas = 4;       // of the sample's excess kurtosis before tails are looked at
constexpr double kTickTolerance = 1.01e-6;  // s: files keep whole microseconds
constexpr double kMinTick = 20e-6;          // s
constexpr double kMaxSlope = 10;

// The maximum of f on [low, high] by golden section.
double Maximise(const std::function<double(double)>& f, double low, double high, int steps, double* most) {
  const double golden = 0.5 * (std::sqrt(5.0) - 1);
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double fa = f(a), fb = f(b);
  for (int step = 0; step < steps; ++step) {
    if (fa > fb)
      high = b, b = a, fb = fa, a = high - golden * (high - low), fa = f(a);
    else
      low = a, a = b, fa = fb, b = low + golden * (high - low), fb = f(b);
  }
  *most = std::max(fa, fb);
  return fa > fb ? a : b;
}

// Standard error from the curvature of a log likelihood at its maximum.
double CurvatureError(const std::function<double(double)>& f, double at, double step) {
  const double bend = f(at + step) + f(at - step) - 2 * f(at);
  return bend < 0 ? step / std::sqrt(-bend) : 0;
}

std::vector<NoisyTouch> Collect(const Observations& o, const std::vector<double>& residuals,
                                const std::vector<double>& tangents) {
  std::vector<NoisyTouch> all;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    NoisyTouch touch;
    touch.k = k;
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      if (std::isnan(residuals[e]) || std::isnan(tangents[e])) continue;
      touch.residual_s.push_back(residuals[e]);
      touch.tangent.push_back(std::min(tangents[e], 10.0));
    }
    if (touch.residual_s.size() >= 2) all.push_back(std::move(touch));
  }
  return all;
}

std::vector<NoisyTouch> Thinned(const std::vector<NoisyTouch>& all) {
  if (static_cast<int>(all.size()) <= kMaxTouches) return all;
  std::vector<NoisyTouch> part;
  for (int j = 0; j < kMaxTouches; ++j) part.push_back(all[all.size() * j / kMaxTouches]);
  return part;
}

// Excess kurtosis of residuals in units of their own scale.
bool TailsLookHeavy(const std::vector<NoisyTouch>& touches, const NoiseModel& model) {
  double second = 0, fourth = 0, count = 0;
  for (const NoisyTouch& touch : touches) {
    const double n = static_cast<double>(touch.residual_s.size());
    for (size_t i = 0; i < touch.residual_s.size(); ++i) {
      const double x = touch.residual_s[i] / std::sqrt(1 - 1 / n) / (1 + model.slope * touch.tangent[i]);
      second += x * x, fourth += x * x * x * x, count += 1;
    }
  }
  if (count < 20 || second <= 0) return false;
  return fourth * count / (second * second) - 3 > kKurtosisSigmas * std::sqrt(24 / count);
}

// Times of a polling loop differ by whole multiples of its interval.
NoiseEstimate FindPolling(const Observations& o) {
  std::vector<double> differences;
  for (int k = 0; k < o.size() && differences.size() < 6000; ++k) {
    if (!o.used[k]) continue;
    double least = INFINITY;
    for (int i = 0; i < o.fingers; ++i) {
      const double time = o.time_s[static_cast<size_t>(k) * o.fingers + i];
      if (time < least) least = time;
    }
    for (int i = 0; i < o.fingers; ++i) {
      const double time = o.time_s[static_cast<size_t>(k) * o.fingers + i];
      if (time > least) differences.push_back(time - least);
    }
  }
  NoiseEstimate none;
  if (differences.size() < 20) return none;
  std::sort(differences.begin(), differences.end());
  // The smallest step between different values is the interval, or a small multiple of it.
  double min_gap = differences[0];
  for (size_t j = 1; j < differences.size(); ++j) {
    const double gap = differences[j] - differences[j - 1];
    if (gap > 2 * kTickTolerance) min_gap = std::min(min_gap, gap);
  }
  for (int divisor = 1; divisor <= 3; ++divisor) {
    double interval = min_gap / divisor;
    if (interval < kMinTick) break;
    // Refined over ever larger differences, so that the count of ticks stays certain.
    bool fits = true;
    for (size_t known = 1; known < differences.size() && fits; known *= 2) {
      double sum_nd = 0, sum_nn = 0;
      for (size_t j = 0; j < std::min(2 * known, differences.size()); ++j) {
        const double ticks = std::round(differences[j] / interval);
        sum_nd += ticks * differences[j], sum_nn += ticks * ticks;
      }
      if (!(sum_nn > 0))
        fits = false;
      else
        interval = sum_nd / sum_nn;
    }
    size_t on_tick = 0;
    for (const double difference : differences)
      on_tick += std::abs(difference - std::round(difference / interval) * interval) <= kTickTolerance;
    if (!fits || on_tick < 0.99 * differences.size()) continue;
    NoiseEstimate found;
    found.value = interval;
    found.std_error =
        0.5e-6 / std::sqrt(static_cast<double>(differences.size())) * interval / differences.back();
    found.std_error = std::max(found.std_error, 1e-9);
    // Each difference would fall on a tick by chance with this probability.
    found.gain_nats = differences.size() * std::log(interval / (2 * kTickTolerance));
    return found;
  }
  return none;
}

// Contacts of one finger at one pose: how many were expected, how many silent.
struct Repeats {
  double all = 0, silent = 0;
  bool AlwaysSilent() const { return all > 1 && silent == all; }
};

// A finger that is silent in every repeat of a pose is out of reach there (the stroke ended, a sensor cannot
// see it); that is no chance, unless chance alone would bring about as many such fingers.
NoiseEstimate FindMissed(const Observations& o, const std::vector<char>& expected) {
  std::map<std::pair<int, int>, Repeats> groups;  // by pose and finger
  for (int k = 0; k < o.size(); ++k)
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      if (!expected[e]) continue;
      Repeats& group = groups[{o.pose[k], i}];
      group.all += 1;
      group.silent += std::isnan(o.time_s[e]);
    }
  double silent = 0, all = 0, always = 0;
  for (const auto& [key, group] : groups) {
    always += group.AlwaysSilent();
    if (!group.AlwaysSilent()) silent += group.silent, all += group.all;
  }
  const double sometimes = all > 0 ? silent / all : 0;
  double by_chance = 0;
  for (const auto& [key, group] : groups)
    if (group.all > 1) by_chance += std::pow(sometimes, group.all);
  if (always <= by_chance + 3 * std::sqrt(by_chance) + 0.5)
    for (const auto& [key, group] : groups)
      if (group.AlwaysSilent()) silent += group.silent, all += group.all;

  NoiseEstimate found;
  if (silent < 3 || silent < 0.002 * all) return found;
  found.value = silent / all;
  found.std_error = std::sqrt(found.value * (1 - found.value) / all);
  found.gain_nats = silent * std::log(1 / 1e-4);
  return found;
}

}  // namespace

NoiseFindings FindNoise(const Observations& o, const std::vector<double>& residuals,
                        const std::vector<double>& tan_incidence, const std::vector<char>& expected,
                        double taken) {
  NoiseFindings found;
  found.poll_interval_s = FindPolling(o);
  found.missed_probability = FindMissed(o, expected);
  const std::vector<NoisyTouch> all = Collect(o, residuals, tan_incidence);
  if (all.empty()) return found;
  const std::vector<NoisyTouch> touches = Thinned(all);

  NoiseModel best;
  double best_log = ProfileSigma(touches, &best);
  double degrees = 0;
  for (const NoisyTouch& touch : all) degrees += static_cast<double>(touch.residual_s.size()) - 1;

  // Does it grow on slopes?
  const auto with_slope = [&](NoiseModel from, double* log_likelihood) {
    NoiseModel sloped = from;
    const auto at = [&](double log_slope) {
      sloped.slope = std::exp(log_slope);
      sloped.sigma_s = from.sigma_s;
      return ProfileSigma(touches, &sloped);
    };
    const int steps = from.shape == NoiseShape::kGaussian ? 20 : 8;
    const double log_slope = Maximise(at, std::log(0.02), std::log(kMaxSlope), steps, log_likelihood);
    at(log_slope);
    return sloped;
  };
  double sloped_log = -INFINITY;
  const NoiseModel sloped = with_slope(best, &sloped_log);
  double slope_gain = sloped_log - best_log;
  if (slope_gain >= kEnterNats) best = sloped, best_log = sloped_log;

  // Heavy tails, or a few outliers among Gaussian noise?
  if (TailsLookHeavy(touches, best)) {
    NoiseModel student = best;
    student.shape = NoiseShape::kStudent;
    const auto student_at = [&](double log_degrees) {
      student.degrees = std::exp(log_degrees);
      student.sigma_s = best.sigma_s;
      return ProfileSigma(touches, &student);
    };
    double student_log = -INFINITY;
    const double log_degrees = Maximise(student_at, std::log(1.2), std::log(60.0), 9, &student_log);
    NoiseModel mixture;
    double mixture_log = -INFINITY;
    for (const double width : {6.0, 15.0, 40.0, 100.0})
      for (const double share : {0.002, 0.007, 0.02, 0.05}) {
        NoiseModel at = best;
        at.shape = NoiseShape::kMixture;
        at.width = width, at.share = share;
        const double value = ProfileSigma(touches, &at);
        if (value > mixture_log) mixture_log = value, mixture = at;
      }
    const double before = best_log;
    if (student_log - before >= kEnterNats && student_log >= mixture_log - 3) {
      const double bend = CurvatureError(student_at, log_degrees, 0.1);
      student_at(log_degrees);
      found.degrees_of_freedom = {student.degrees, student.degrees * bend, student_log - before};
      best = student, best_log = student_log;
    } else if (mixture_log - before >= kEnterNats) {
      for (const NoisyTouch& touch : all)
        if (OutlierProbability(touch, mixture) > 0.5) found.outliers.push_back(touch.k);
      best = mixture, best_log = mixture_log;
    }
    // Tails may have looked like a slope.
    if (slope_gain >= kEnterNats && best.shape != NoiseShape::kGaussian) {
      NoiseModel level = best;
      level.slope = 0;
      slope_gain = best_log - ProfileSigma(touches, &level);
      if (slope_gain < kEnterNats) {
        best = level;
        if (best.shape == NoiseShape::kStudent) {
          student = level;
          double level_log = -INFINITY;
          const double log_level = Maximise(student_at, std::log(1.2), std::log(60.0), 9, &level_log);
          const double bend = CurvatureError(student_at, log_level, 0.1);
          student_at(log_level);
          found.degrees_of_freedom = {student.degrees, student.degrees * bend, student_log - before};
          best = student;
        }
      }
    }
  }
  if (slope_gain >= kEnterNats) {
    NoiseModel at = best;
    const auto by_slope = [&](double slope) {
      at.slope = slope;
      at.sigma_s = best.sigma_s;
      return ProfileSigma(touches, &at);
    };
    found.slope = {best.slope, CurvatureError(by_slope, best.slope, 0.05 * best.slope), slope_gain};
  }
  // What the fit has followed of the noise is given back.
  const double left = std::max(degrees - taken, 1.0);
  best.sigma_s *= std::sqrt(degrees / left);
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

  // What a touch should count for where the noise is not the same everywhere.
  if (found.degrees_of_freedom.gain_nats > 0 || found.slope.gain_nats > 0) {
    found.weights.assign(o.size(), 1.0);
    const double nu = found.degrees_of_freedom.gain_nats > 0 ? best.degrees : INFINITY;
    for (const NoisyTouch& touch : all) {
      double squares = 0, variance = 0;
      const double n = static_cast<double>(touch.residual_s.size());
      for (size_t i = 0; i < touch.residual_s.size(); ++i) {
        const double s = best.sigma_s * (1 + best.slope * touch.tangent[i]);
        squares += touch.residual_s[i] * touch.residual_s[i] / (s * s);
        variance += s * s / n;
      }
      double weight = best.sigma_s * best.sigma_s / variance;
      if (std::isfinite(nu)) weight *= (nu + n - 1) / (nu + squares);
      found.weights[touch.k] = weight;
    }
  }
  return found;
}

}  // namespace touchstone
