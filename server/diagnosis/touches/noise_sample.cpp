#include "server/diagnosis/touches/noise_sample.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace touchstone::diagnosis::touches {
namespace {

constexpr double kMaxTangent = 10;
constexpr size_t kMaxDelays = 6000;

std::vector<inference::ReadingGroup> GroupsOf(const Observations& o, const std::vector<double>& residuals_s,
                                              const std::vector<double>& tan_incidence) {
  std::vector<inference::ReadingGroup> groups;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    inference::ReadingGroup group;
    group.index = k;
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      if (std::isnan(residuals_s[e]) || std::isnan(tan_incidence[e])) continue;
      group.residual_s.push_back(residuals_s[e]);
      group.growth.push_back(std::min(tan_incidence[e], kMaxTangent));
    }
    if (group.residual_s.size() >= 2) groups.push_back(std::move(group));
  }
  return groups;
}

// Times after the touch's first finger.
std::vector<double> DelaysOf(const Observations& o) {
  std::vector<double> delays_s;
  for (int k = 0; k < o.size() && delays_s.size() < kMaxDelays; ++k) {
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
std::vector<inference::RepeatedReading> RepeatedOf(const Observations& o, const std::vector<char>& expected) {
  std::map<std::pair<int, int>, inference::RepeatedReading> by_pose_and_finger;
  for (int k = 0; k < o.size(); ++k)
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      if (!expected[e]) continue;
      inference::RepeatedReading& reading = by_pose_and_finger[{o.pose[k], i}];
      reading.expected += 1;
      reading.silent += std::isnan(o.time_s[e]);
    }
  std::vector<inference::RepeatedReading> repeated;
  for (const auto& [key, reading] : by_pose_and_finger) repeated.push_back(reading);
  return repeated;
}

}  // namespace

inference::NoiseSample MakeNoiseSample(const Observations& observations,
                                       const std::vector<double>& residuals_s,
                                       const std::vector<double>& tan_incidence,
                                       const std::vector<char>& expected) {
  inference::NoiseSample sample;
  sample.groups = GroupsOf(observations, residuals_s, tan_incidence);
  sample.delays_s = DelaysOf(observations);
  sample.repeated = RepeatedOf(observations, expected);
  sample.size = observations.size();
  return sample;
}

}  // namespace touchstone::diagnosis::touches
