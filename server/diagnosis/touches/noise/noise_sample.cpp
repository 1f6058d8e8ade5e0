#include "server/diagnosis/touches/noise/noise_sample.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/diagnosis/touches/noise/rules.h"

namespace touchstone::diagnosis::touches {
namespace {

std::vector<ReadingGroup> GroupsOf(const Observations& o, const std::vector<double>& residuals_s,
                                   const std::vector<double>& tan_incidence) {
  std::vector<ReadingGroup> groups;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    ReadingGroup group;
    group.index = k;
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      if (std::isnan(residuals_s[e]) || std::isnan(tan_incidence[e])) continue;
      group.residual_s.push_back(residuals_s[e]);
      group.growth.push_back(std::min(tan_incidence[e], kNoiseRules.max_tangent.value()));
      group.channel.push_back(i);
    }
    if (group.residual_s.size() >= 2) groups.push_back(std::move(group));
  }
  return groups;
}

// Sets the slowness of every group; returns what it is relative to.
double SetSlowness(const Observations& o, std::vector<ReadingGroup>* groups) {
  double squares = 0;
  for (ReadingGroup& group : *groups) {
    group.slowness = 1 / o.set->speed_m_s[o.row[group.index]];
    squares += group.slowness * group.slowness;
  }
  const double root_mean_square = std::sqrt(squares / std::max<size_t>(groups->size(), 1));
  for (ReadingGroup& group : *groups) group.slowness /= root_mean_square;
  return root_mean_square;
}

// Residuals of repeats (one pose, the same fingers) less their mean, enlarged by what the mean has followed.
std::vector<ReadingGroup> RepeatsOf(const Observations& o, const std::vector<ReadingGroup>& groups) {
  struct Mean {
    double touches = 0;
    std::vector<double> sum_s;
  };
  std::map<std::pair<int, std::vector<int>>, Mean> means;
  for (const ReadingGroup& group : groups) {
    Mean& mean = means[{o.pose[group.index], group.channel}];
    mean.sum_s.resize(group.residual_s.size());
    ++mean.touches;
    for (size_t i = 0; i < group.residual_s.size(); ++i) mean.sum_s[i] += group.residual_s[i];
  }
  std::vector<ReadingGroup> repeats;
  for (const ReadingGroup& group : groups) {
    const Mean& mean = means[{o.pose[group.index], group.channel}];
    if (mean.touches < 2) continue;
    repeats.push_back(group);
    const double enlarge = std::sqrt(mean.touches / (mean.touches - 1));
    for (size_t i = 0; i < group.residual_s.size(); ++i)
      repeats.back().residual_s[i] = enlarge * (group.residual_s[i] - mean.sum_s[i] / mean.touches);
  }
  return repeats;
}

// Times after the touch's first finger.
std::vector<double> DelaysOf(const Observations& o) {
  std::vector<double> delays_s;
  for (int k = 0; k < o.size() && delays_s.size() < kNoiseRules.max_delays; ++k) {
    if (!o.used[k]) continue;
    double first_s = INFINITY;
    for (int i = 0; i < o.fingers; ++i) {
      const double time_s = o.time_s[static_cast<size_t>(k) * o.fingers + i];
      if (time_s < first_s) first_s = time_s;
    }
    for (int i = 0; i < o.fingers; ++i) {
      const double time_s = o.time_s[static_cast<size_t>(k) * o.fingers + i];
      if (time_s > first_s) delays_s.push_back(time_s - first_s);
    }
  }
  return delays_s;
}

// Contacts of one finger at one pose.
std::vector<RepeatedReading> RepeatedOf(const Observations& o, const std::vector<char>& expected) {
  std::map<std::pair<int, int>, RepeatedReading> by_pose_and_finger;
  for (int k = 0; k < o.size(); ++k)
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      if (!expected[e]) continue;
      RepeatedReading& reading = by_pose_and_finger[{o.pose[k], i}];
      reading.expected += 1;
      reading.silent += std::isnan(o.time_s[e]);
    }
  std::vector<RepeatedReading> repeated;
  for (const auto& [key, reading] : by_pose_and_finger) repeated.push_back(reading);
  return repeated;
}

}  // namespace

std::vector<char> ExpectedReadings(const Observations& o, const Prediction& prediction) {
  double farthest_m = 0;
  for (size_t e = 0; e < o.time_s.size(); ++e)
    if (!std::isnan(o.time_s[e]) && prediction.travel_m[e] > farthest_m) farthest_m = prediction.travel_m[e];
  std::vector<char> expected(o.time_s.size());
  for (size_t e = 0; e < expected.size(); ++e)
    expected[e] = !std::isnan(prediction.time_s[e]) && prediction.travel_m[e] <= farthest_m;
  return expected;
}

std::vector<double> TangentsOfIncidence(const Prediction& prediction) {
  std::vector<double> tangents;
  for (const double cos_incidence : prediction.cos_incidence) {
    const double cosine = std::clamp(cos_incidence, 0.05, 1.0);
    tangents.push_back(std::sqrt(1 / (cosine * cosine) - 1));
  }
  return tangents;
}

NoiseSample MakeNoiseSample(const Observations& observations, const std::vector<double>& residuals_s,
                            const std::vector<double>& tan_incidence, const std::vector<char>& expected) {
  NoiseSample sample;
  sample.groups = GroupsOf(observations, residuals_s, tan_incidence);
  sample.rms_slowness_s_per_m = SetSlowness(observations, &sample.groups);
  sample.repeats = RepeatsOf(observations, sample.groups);
  sample.channels = observations.fingers;
  sample.delays_s = DelaysOf(observations);
  sample.repeated = RepeatedOf(observations, expected);
  sample.size = observations.size();
  return sample;
}

NoiseSample MakeNoiseSample(const Observations& observations, const std::vector<double>& residuals_s,
                            const Prediction& prediction) {
  return MakeNoiseSample(observations, residuals_s, TangentsOfIncidence(prediction),
                         ExpectedReadings(observations, prediction));
}

}  // namespace touchstone::diagnosis::touches
