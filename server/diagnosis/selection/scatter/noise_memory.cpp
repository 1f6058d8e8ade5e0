#include "server/diagnosis/selection/scatter/noise_memory.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/selection/scatter/rules.h"
#include "server/diagnosis/touches/noise/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// Orthonormal contrasts of complete touches: their correlated noise is independent of one another.
struct Course {
  int channels = 0;
  std::vector<double> gap_s;  // since the touch before; infinite: a new session
  std::vector<double> value;  // [touch * channels + channel]
  int touches() const { return static_cast<int>(gap_s.size()); }
};

Course CourseOf(const touches::Observations& o, const std::vector<double>& residuals) {
  Course course;
  course.channels = o.fingers - 1;
  double last_s = 0;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    const double* r = &residuals[static_cast<size_t>(k) * o.fingers];
    if (std::any_of(r, r + o.fingers, [](double x) { return std::isnan(x); })) continue;
    const double time_s = o.set->session_time_s[o.row[k]];
    const bool begins = course.gap_s.empty() || time_s < last_s;
    course.gap_s.push_back(begins ? INFINITY : time_s - last_s);
    last_s = time_s;
    double sum = 0;
    for (int row = 1; row < o.fingers; ++row) {
      sum += r[row - 1];
      course.value.push_back((r[row] * row - sum) / std::sqrt(row * (row + 1.0)));
    }
  }
  return course;
}

struct CorrelatedLikelihood {
  double log_likelihood = 0;
  double white_s = 0;
};

// Of a level that moves between touches, seen through white noise of unit variance, whose size is profiled (Kalman
// filter). `variance`: of the level before the first touch; `move(gap_s, &mean, &variance)`: what a pause does to it.
template <typename Move>
CorrelatedLikelihood FilterLevel(const Course& course, double variance, const Move& move) {
  const int n = course.touches(), channels = course.channels;
  std::vector<double> mean(channels, 0.0);
  double squares = 0, logs = 0;
  for (int k = 0; k < n; ++k) {
    move(course.gap_s[k], &mean, &variance);
    const double innovation = variance + 1, gain = variance / innovation;
    for (int c = 0; c < channels; ++c) {
      const double apart = course.value[static_cast<size_t>(k) * channels + c] - mean[c];
      squares += apart * apart / innovation;
      mean[c] += gain * apart;
    }
    logs += channels * std::log(innovation);
    variance *= 1 - gain;
  }
  const double count = static_cast<double>(n) * channels;
  const double white2 = std::max(squares / count, 1e-30);
  return {-0.5 * count * std::log(white2) - 0.5 * logs, std::sqrt(white2)};
}

// Variance ratio correlated / white, and correlation time; the white noise is profiled.
CorrelatedLikelihood Likelihood(const Course& course, double ratio, double time_s) {
  return FilterLevel(course, ratio, [&](double gap_s, std::vector<double>* mean, double* variance) {
    const double rho = std::exp(-gap_s / time_s);
    *variance = rho * rho * *variance + (1 - rho * rho) * ratio;
    for (double& level : *mean) level *= rho;
  });
}

// The same of a walk, which remembers for ever: its variance grows by `rate` of the white noise's a second from `start`.
double WalkLogLikelihood(const Course& course, double start, double rate) {
  const auto move = [&](double gap_s, std::vector<double>* mean, double* variance) {
    if (std::isfinite(gap_s)) {
      *variance += rate * gap_s;
      return;
    }
    *variance = start;
    std::fill(mean->begin(), mean->end(), 0.0);
  };
  return FilterLevel(course, start, move).log_likelihood;
}

// The best walk: correlated noise spreads at first by 2 variance / time a second.
double BestWalk(const Course& course, double ratio, double time_s) {
  double best = -INFINITY;
  for (int a = -6; a <= 6; ++a)
    for (const double start : {0.0, 0.1 * ratio, ratio})
      best = std::max(best, WalkLogLikelihood(course, start, 2 * ratio / time_s * std::exp(0.25 * a)));
  return best;
}

// The same of a course without corners: a Matern process of order 3/2, whose slope is continuous, as a Kalman filter over
// value and slope (Hartikainen and Sarkka, Kalman filtering and smoothing solutions to temporal Gaussian process
// regression models, 2010).
CorrelatedLikelihood SmoothLikelihood(const Course& course, double ratio, double time_s) {
  const int n = course.touches(), channels = course.channels;
  const double rate = std::sqrt(3.0) / time_s;
  Eigen::Matrix2d stationary = Eigen::Matrix2d::Zero();
  stationary.diagonal() << ratio, ratio * rate * rate;
  Eigen::Matrix2Xd mean = Eigen::Matrix2Xd::Zero(2, channels);
  Eigen::Matrix2d covariance = stationary;
  double squares = 0, logs = 0;
  for (int k = 0; k < n; ++k) {
    const double gap_s = course.gap_s[k], decay = std::isfinite(gap_s) ? std::exp(-rate * gap_s) : 0;
    Eigen::Matrix2d step = Eigen::Matrix2d::Zero();
    if (decay > 0) step << 1 + rate * gap_s, gap_s, -rate * rate * gap_s, 1 - rate * gap_s;
    step *= decay;
    covariance = step * (covariance - stationary) * step.transpose() + stationary;
    mean = step * mean;
    const double innovation = covariance(0, 0) + 1;
    const Eigen::Vector2d gain = covariance.col(0) / innovation;
    for (int c = 0; c < channels; ++c) {
      const double apart = course.value[static_cast<size_t>(k) * channels + c] - mean(0, c);
      squares += apart * apart / innovation;
      mean.col(c) += gain * apart;
    }
    logs += channels * std::log(innovation);
    covariance -= gain * gain.transpose() * innovation;
  }
  const double count = static_cast<double>(n) * channels;
  const double white2 = std::max(squares / count, 1e-30);
  return {-0.5 * count * std::log(white2) - 0.5 * logs, std::sqrt(white2)};
}

// Standard error of the logarithm of one coordinate: curvature of the likelihood along it.
double LogError(const Course& course, double ratio, double time_s, bool of_time) {
  const auto at = [&](double step) {
    const double factor = std::exp(step);
    return Likelihood(course, of_time ? ratio : ratio * factor, of_time ? time_s * factor : time_s)
        .log_likelihood;
  };
  const double curvature = (2 * at(0) - at(kScatterRules.memory_step) - at(-kScatterRules.memory_step)) /
                           (kScatterRules.memory_step * kScatterRules.memory_step);
  return curvature > 1e-3 ? 1 / std::sqrt(curvature) : 30;
}

// Touches begin to end as a course of their own.
Course PartOf(const Course& course, int begin, int end) {
  Course part;
  part.channels = course.channels;
  part.gap_s.assign(course.gap_s.begin() + begin, course.gap_s.begin() + end);
  part.gap_s[0] = INFINITY;
  part.value.assign(course.value.begin() + static_cast<long>(begin) * course.channels,
                    course.value.begin() + static_cast<long>(end) * course.channels);
  return part;
}

bool ShowsEverywhere(const Course& course, double ratio, double time_s) {
  int quarters = 0;
  for (int q = 0; q < 4; ++q) {
    const Course part = PartOf(course, course.touches() * q / 4, course.touches() * (q + 1) / 4);
    quarters += Likelihood(part, ratio, time_s).log_likelihood > Likelihood(part, 0, time_s).log_likelihood;
  }
  return quarters >= 3;
}

// One step of the fingers at the moment that fits best.
double StepGain(const Course& course) {
  const int n = course.touches(), channels = course.channels;
  std::vector<double> total(channels, 0.0), head(channels, 0.0);
  double squares = 0;
  for (int k = 0; k < n; ++k)
    for (int c = 0; c < channels; ++c) {
      const double x = course.value[static_cast<size_t>(k) * channels + c];
      total[c] += x;
      squares += x * x;
    }
  double best = 0;
  for (int k = 0; k + 1 < n; ++k) {
    double explained = 0;
    for (int c = 0; c < channels; ++c) {
      head[c] += course.value[static_cast<size_t>(k) * channels + c];
      const double tail = total[c] - head[c];
      explained += head[c] * head[c] / (k + 1) + tail * tail / (n - k - 1);
    }
    best = std::max(best, explained);
  }
  const double count = static_cast<double>(n) * channels;
  return -0.5 * count * std::log(std::max(1 - best / squares, 1e-12)) - channels * std::log(count) -
         std::log(n);
}

// A course that repeats at least three times, in steps of a quarter of a cycle over the whole session.
double PeriodGain(const Course& course) {
  constexpr int kPhases = 12;
  const int n = course.touches(), channels = course.channels;
  std::vector<double> at_s(n, 0.0);
  double squares = 0;
  for (int k = 1; k < n; ++k) at_s[k] = at_s[k - 1] + (std::isfinite(course.gap_s[k]) ? course.gap_s[k] : 0);
  for (const double x : course.value) squares += x * x;
  const double count = static_cast<double>(n) * channels, span_s = at_s.back();
  double best = -INFINITY;
  int tried = 0;
  for (double cycles = kScatterRules.min_cycles; cycles <= n / 8.0; cycles += 0.25, ++tried) {
    std::vector<double> sum(static_cast<size_t>(kPhases) * channels, 0.0);
    double touches[kPhases] = {};
    for (int k = 0; k < n; ++k) {
      const double turns = cycles * at_s[k] / span_s;
      const int phase = std::min(static_cast<int>(kPhases * (turns - std::floor(turns))), kPhases - 1);
      touches[phase] += 1;
      for (int c = 0; c < channels; ++c)
        sum[static_cast<size_t>(phase) * channels + c] += course.value[static_cast<size_t>(k) * channels + c];
    }
    double explained = 0;
    for (int phase = 0; phase < kPhases; ++phase)
      for (int c = 0; c < channels && touches[phase] > 0; ++c) {
        const double s = sum[static_cast<size_t>(phase) * channels + c];
        explained += s * s / touches[phase];
      }
    best = std::max(best, -0.5 * count * std::log(std::max(1 - explained / squares, 1e-12)));
  }
  return tried > 0 ? best - 0.5 * kPhases * channels * std::log(count) - std::log(tried) : best;
}

struct BestCorrelated {
  CorrelatedLikelihood likelihood;
  double ratio = 1, time_s = 0;
};

// The maximum of a likelihood: a coarse grid over ratio and time, then ever finer ones round the best.
BestCorrelated FindBest(CorrelatedLikelihood (*likelihood)(const Course&, double, double),
                        const Course& course, double min_s, double max_s) {
  BestCorrelated best;
  best.time_s = std::sqrt(min_s * max_s);
  best.likelihood = likelihood(course, best.ratio, best.time_s);
  double ratio_width = std::log(1e3), time_width = 0.5 * std::log(max_s / min_s);
  for (int pass = 0; pass < 7; ++pass) {
    const double ratio_centre = best.ratio, time_centre = best.time_s;
    for (int a = -4; a <= 4; ++a)
      for (int b = -4; b <= 4; ++b) {
        const double ratio = ratio_centre * std::exp(ratio_width * a / 4);
        const double time_s = std::clamp(time_centre * std::exp(time_width * b / 4), min_s, max_s);
        const CorrelatedLikelihood here = likelihood(course, ratio, time_s);
        if (here.log_likelihood > best.likelihood.log_likelihood) best = {here, ratio, time_s};
      }
    ratio_width *= 0.4;
    time_width *= 0.4;
  }
  return best;
}

// The session of complete touches; nothing where it cannot show a memory.
struct SessionCourse {
  Course course;
  double min_s = 0, max_s = 0;  // times of memory that it can show
};

std::optional<SessionCourse> SessionOf(const touches::Observations& o, const std::vector<double>& residuals) {
  if (!o.set->has_session_time || o.fingers < 2) return std::nullopt;
  SessionCourse session{CourseOf(o, residuals)};
  if (session.course.touches() < kScatterRules.min_complete) return std::nullopt;
  double span_s = 0;
  for (const double gap_s : session.course.gap_s)
    if (std::isfinite(gap_s)) span_s += gap_s;
  session.min_s = span_s / session.course.touches(), session.max_s = span_s / 2;
  if (!(session.min_s > 0)) return std::nullopt;
  return session;
}

}  // namespace

std::optional<NoiseMemory> FindNoiseMemory(const touches::Observations& o,
                                           const std::vector<double>& residuals) {
  const std::optional<SessionCourse> session = SessionOf(o, residuals);
  if (!session) return std::nullopt;
  const Course& course = session->course;
  const double min_s = session->min_s, max_s = session->max_s;
  const BestCorrelated correlated = FindBest(Likelihood, course, min_s, max_s);
  const CorrelatedLikelihood& best = correlated.likelihood;
  const double ratio = correlated.ratio, time_s = correlated.time_s;
  const double count = static_cast<double>(course.touches()) * course.channels;
  NoiseMemory found;
  found.gain_nats = best.log_likelihood - Likelihood(course, 0, time_s).log_likelihood - std::log(count);
  found.log_likelihood = best.log_likelihood;
  found.white_log_likelihood = Likelihood(course, 0, time_s).log_likelihood;
  found.complexity_nats = std::log(count);
  found.forgets_nats = best.log_likelihood - BestWalk(course, ratio, time_s);
  found.everywhere = ShowsEverywhere(course, ratio, time_s);
  found.step_gain_nats = StepGain(course);
  found.smooth_gain_nats = FindBest(SmoothLikelihood, course, min_s, max_s).likelihood.log_likelihood -
                           Likelihood(course, 0, time_s).log_likelihood - std::log(count);
  found.period_gain_nats = PeriodGain(course);
  const double ratio_error = LogError(course, ratio, time_s, false);
  const double time_error = LogError(course, ratio, time_s, true);
  // The noise without memory depends on the ratio and the time too.
  const double by_ratio_s =
      Likelihood(course, ratio * std::exp(std::min(ratio_error, kScatterRules.memory_max_step.value())),
                 time_s)
          .white_s -
      best.white_s;
  const double by_time_s =
      Likelihood(course, ratio,
                 time_s * std::exp(std::min(time_error, kScatterRules.memory_max_step.value())))
          .white_s -
      best.white_s;
  found.white_s = {best.white_s, std::hypot(best.white_s / std::sqrt(2 * count), by_ratio_s, by_time_s), 0};
  found.sigma_s = {best.white_s * std::sqrt(ratio), 0, found.gain_nats};
  found.sigma_s.std_error = 0.5 * found.sigma_s.value * ratio_error;
  found.time_s = {time_s, time_s * time_error, found.gain_nats};
  return found;
}

bool RevertsToMean(const NoiseMemory& memory) {
  return memory.forgets_nats > kScatterRules.forgets;
}

DeclaredMemory AssessDeclaredMemory(const touches::Observations& o, const std::vector<double>& residuals,
                                    double sigma_s, double time_s) {
  const std::optional<SessionCourse> session = SessionOf(o, residuals);
  if (!session || !(sigma_s > 0) || time_s > session->max_s) return {};
  const Course& course = session->course;
  const double count = static_cast<double>(course.touches()) * course.channels;
  const double none = Likelihood(course, 0, time_s).log_likelihood;
  // The correlated noise has its size; the white noise beside it is what fits best.
  double declared = -INFINITY;
  for (double log_ratio = std::log(1e-4); log_ratio < std::log(1e4); log_ratio += 0.1) {
    const double ratio = std::exp(log_ratio), white2 = sigma_s * sigma_s / ratio;
    const CorrelatedLikelihood profiled = Likelihood(course, ratio, time_s);
    // The profile leaves a sum of squares of count times its own variance.
    const double over = profiled.white_s * profiled.white_s / white2;
    declared = std::max(declared, profiled.log_likelihood - 0.5 * count * (over - 1 - std::log(over)));
  }
  const double best = FindBest(Likelihood, course, session->min_s, session->max_s).likelihood.log_likelihood;
  return {none - declared > touches::kNoiseRules.declared_excluded,
          best - declared > touches::kNoiseRules.declared_excluded};
}

}  // namespace touchstone::diagnosis::selection
