#include "server/diagnosis/selection/scatter/delay_likelihood.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/selection/scatter/rules.h"
#include "server/diagnosis/touches/noise/golden_section.h"

namespace touchstone::diagnosis::selection {
namespace {

using touches::NoiseModel;
using touches::ReadingGroup;

// Two values. A touch of n fingers has 2^n ways to be late; given one, its readings are normal about their common shift, so that
// density and maximisation are closed forms. Inner products are over the readings less their weighted mean.
class TwoValuedNoise {
 public:
  struct Values {
    double delay = 0, share = 0, sigma_s = 0;
    double gain_nats = 0;  // log likelihood over that of no delays
  };

  // `finger`: which may be late; -1: any. `of_length`: the delay of a touch is `delay` times its slowness.
  TwoValuedNoise(const std::vector<ReadingGroup>& groups, const NoiseModel& scales, int finger,
                 bool of_length) {
    for (const ReadingGroup& group : groups) Add(group, scales, finger, of_length);
    for (const Touch& touch : touches_)
      squares_ += touch.rr, degrees_ += touch.degrees, readings_ += touch.may_be_late;
  }

  Values Fit() const {
    const double all_s = std::sqrt(squares_ / std::max(degrees_, 1.0));
    if (!(all_s > 0)) return {};
    std::vector<Values> starts;
    for (const double delay : {1.5, 2.5, 6.0})
      for (const double share : {0.1, 0.4, 0.6, 0.9}) {
        const double rest = std::sqrt(std::max(1 - share * (1 - share) * delay * delay, 0.05));
        starts.push_back({delay * all_s, share, rest * all_s});
        for (int step = 0; step < kScatterRules.delay_first_steps; ++step) Improve(&starts.back());
      }
    Values best = *std::max_element(starts.begin(), starts.end(), [](const Values& a, const Values& b) {
      return a.gain_nats < b.gain_nats;
    });
    for (int step = 0; step < kScatterRules.delay_steps && best.gain_nats > kScatterRules.delay_first; ++step)
      Improve(&best);
    return best;
  }

  double readings() const { return readings_; }
  double degrees() const { return degrees_; }

 private:
  struct Touch {
    double rr = 0, degrees = 0;
    int may_be_late = 0;
    int ways = 0;
    std::array<double, 1 << kMaxDelayedFingers> rz, zz;  // by which readings are late, as bits
    std::array<int, 1 << kMaxDelayedFingers> late;       // how many
  };

  void Add(const ReadingGroup& group, const NoiseModel& scales, int finger, bool of_length) {
    const size_t n = group.residual_s.size();
    std::vector<size_t> may;
    for (size_t i = 0; i < n; ++i)
      if (finger < 0 || group.channel[i] == finger) may.push_back(i);
    if (n < 3 || n > kMaxDelayedFingers || may.empty()) return;
    std::vector<double> weight(n);
    double all = 0, first = 0, second = 0;
    for (size_t i = 0; i < n; ++i) {
      const double scale = touches::RelativeScale(group, i, scales);
      weight[i] = 1 / (scale * scale);
      all += weight[i], first += weight[i] * group.residual_s[i];
      second += weight[i] * group.residual_s[i] * group.residual_s[i];
    }
    Touch touch;
    touch.rr = second - first * first / all;
    touch.degrees = static_cast<double>(n) - 1;
    touch.may_be_late = static_cast<int>(may.size());
    touch.ways = 1 << may.size();
    const double unit = of_length ? group.slowness : 1;
    for (int way = 0; way < touch.ways; ++way) {
      double z = 0, rz = 0;
      touch.late[way] = 0;
      for (size_t j = 0; j < may.size(); ++j)
        if (way >> j & 1)
          z += weight[may[j]], rz += weight[may[j]] * group.residual_s[may[j]], ++touch.late[way];
      touch.rz[way] = unit * (rz - first * z / all);
      touch.zz[way] = unit * unit * (z - z * z / all);
    }
    touches_.push_back(touch);
  }

  // One step of the expectation-maximisation; `gain_nats` is that of the values before it.
  void Improve(Values* at) const {
    const double none_s = std::sqrt(squares_ / degrees_);
    const double late = std::log(at->share), in_time = std::log1p(-at->share);
    double log_likelihood = 0, rz = 0, zz = 0, share = 0;
    for (const Touch& touch : touches_) {
      std::array<double, 1 << kMaxDelayedFingers> density;
      double largest = -INFINITY;
      for (int way = 0; way < touch.ways; ++way) {
        const double left = touch.rr - 2 * at->delay * touch.rz[way] + at->delay * at->delay * touch.zz[way];
        density[way] = touch.late[way] * late + (touch.may_be_late - touch.late[way]) * in_time -
                       left / (2 * at->sigma_s * at->sigma_s);
        largest = std::max(largest, density[way]);
      }
      double sum = 0;
      for (int way = 0; way < touch.ways; ++way) sum += density[way] = std::exp(density[way] - largest);
      log_likelihood += largest + std::log(sum) - touch.degrees * std::log(at->sigma_s / none_s) +
                        touch.rr / (2 * none_s * none_s);
      for (int way = 0; way < touch.ways; ++way) {
        const double p = density[way] / sum;
        rz += p * touch.rz[way], zz += p * touch.zz[way];
        share += p * touch.late[way];
      }
    }
    const double delay = zz > 0 ? rz / zz : at->delay;
    // What the new delay leaves, of the same ways.
    const double squares = squares_ - 2 * delay * rz + delay * delay * zz;
    at->gain_nats = log_likelihood;
    at->delay = delay;
    at->sigma_s = std::sqrt(std::max(squares / degrees_, 1e-6 * none_s * none_s));
    at->share = std::clamp(share / readings_, 1e-6, 1 - 1e-6);
  }

  std::vector<Touch> touches_;
  double squares_ = 0, degrees_ = 0, readings_ = 0;
};

double NormalDensity(double x) {
  return std::exp(-0.5 * x * x) / std::sqrt(2 * kPi);
}

double NormalBelow(double x) {
  return 0.5 * std::erfc(-x / std::sqrt(2.0));
}

// Density of normal noise of scale `s` plus a delay of this shape and size, s.
double DelayedDensity(double x, double s, DelayShape shape, double size, double share) {
  switch (shape) {
    case DelayShape::kTwoValues:
      return ((1 - share) * NormalDensity(x / s) + share * NormalDensity((x - size) / s)) / s;
    case DelayShape::kUniform:
      return (NormalBelow(x / s) - NormalBelow((x - size) / s)) / size;
    case DelayShape::kEarly:
      x = -x;
      [[fallthrough]];
    case DelayShape::kLate: {
      const double ratio = s / size;
      return std::exp(0.5 * ratio * ratio - x / size) * NormalBelow(x / s - ratio) / size;
    }
  }
  return 0;
}

}  // namespace

TwoValues FitTwoValues(const std::vector<ReadingGroup>& groups, const NoiseModel& scales, int finger,
                       bool of_length) {
  const TwoValuedNoise noise(groups, scales, finger, of_length);
  const TwoValuedNoise::Values best = noise.Fit();
  TwoValues found;
  found.noise = {DelayShape::kTwoValues, finger, of_length, best.delay, best.share, best.sigma_s};
  found.gain_nats = best.gain_nats;
  found.late_readings = best.share * noise.readings();
  found.readings = noise.readings();
  found.degrees_of_freedom = noise.degrees();
  return found;
}

// Each touch's density is integrated over its common shift by the trapezoidal rule, which is exact to rounding for steps of half
// the noise.
double DelayedLogLikelihood(const std::vector<ReadingGroup>& groups, const NoiseModel& scales,
                            const DelayedNoise& delay) {
  double sum = 0;
  for (const ReadingGroup& group : groups) {
    const double unit = delay.of_length ? group.slowness : 1;
    const size_t n = group.residual_s.size();
    std::vector<double> scale_s(n);
    for (size_t i = 0; i < n; ++i) scale_s[i] = delay.sigma_s * touches::RelativeScale(group, i, scales);
    const double finest_s = *std::min_element(scale_s.begin(), scale_s.end());
    const double widest_s = *std::max_element(scale_s.begin(), scale_s.end());
    const auto [first, last] = std::minmax_element(group.residual_s.begin(), group.residual_s.end());
    const double reach_s = 5 * widest_s + (delay.shape == DelayShape::kTwoValues ? 1 : 4) * unit * delay.size;
    const double step_s = 0.5 * finest_s;
    double integral = 0;
    for (double shift_s = *first - reach_s; shift_s < *last + reach_s; shift_s += step_s) {
      double product = 1;
      for (size_t i = 0; i < n && product > 0; ++i) {
        const double x = group.residual_s[i] - shift_s;
        product *= delay.finger >= 0 && group.channel[i] != delay.finger
                       ? NormalDensity(x / scale_s[i]) / scale_s[i]
                       : DelayedDensity(x, scale_s[i], delay.shape, unit * delay.size, delay.share);
      }
      integral += product * step_s;
    }
    sum += std::log(std::max(integral, 1e-300));
  }
  return sum;
}

DelayedNoise FitShape(const std::vector<ReadingGroup>& groups, const NoiseModel& scales, DelayShape shape,
                      const DelayedNoise& two_values, double* log_likelihood) {
  DelayedNoise noise = two_values;
  noise.shape = shape;
  const double variance = two_values.sigma_s * two_values.sigma_s +
                          two_values.share * (1 - two_values.share) * two_values.size * two_values.size;
  // By the log odds of the variance that is the delay's.
  const auto set = [&](double log_odds) {
    const double of_delay = 1 / (1 + std::exp(-log_odds));
    noise.size = std::sqrt(of_delay * variance * (shape == DelayShape::kUniform ? 12 : 1));
    noise.sigma_s = std::sqrt((1 - of_delay) * variance);
  };
  const auto at = [&](double log_odds) {
    set(log_odds);
    return DelayedLogLikelihood(groups, scales, noise);
  };
  set(touches::Maximise(at, -1, 7, kScatterRules.delay_sections, log_likelihood));
  return noise;
}

}  // namespace touchstone::diagnosis::selection
