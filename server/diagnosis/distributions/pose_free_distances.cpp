#include "server/diagnosis/distributions/pose_free_distances.h"

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::distributions {

PoseFreeSample MakePoseFreeSample(const std::vector<double>& time_s, int fingers, double speed_m_s,
                                  double spacing_m) {
  PoseFreeSample sample;
  sample.points = ToPoints(time_s, fingers);
  sample.within_s = MeanDistance(sample.points, sample.points);
  sample.statistics = TouchStatistics(time_s, fingers, speed_m_s, spacing_m);
  return sample;
}

std::vector<double> PoseFreeDistances(const PoseFreeSample& set, const PoseFreeSample& reference) {
  std::vector<double> distances;
  const double between = MeanDistance(set.points, reference.points);
  distances.push_back(std::max(0.0, 2 * between - set.within_s - reference.within_s));
  for (size_t s = 0; s < set.statistics.size(); ++s)
    distances.push_back(KolmogorovDistance(set.statistics[s].sorted, reference.statistics[s].sorted));
  return distances;
}

std::vector<double> PoseFreeDistances(const std::vector<PoseFreeSample>& set,
                                      const std::vector<PoseFreeSample>& reference) {
  std::vector<double> all;
  double touches = 0;
  for (size_t o = 0; o < set.size(); ++o) {
    const double weight = set[o].points.size();
    if (weight == 0) continue;
    const std::vector<double> distances = PoseFreeDistances(set[o], reference[o]);
    all.resize(distances.size(), 0);
    for (size_t m = 0; m < distances.size(); ++m) all[m] += weight * distances[m];
    touches += weight;
  }
  for (double& distance : all) distance /= touches;
  return all;
}

PoseFreeNull::PoseFreeNull(std::vector<std::vector<double>> distances) {
  const size_t measures = distances.empty() ? 0 : distances[0].size();
  sorted_.resize(measures);
  for (size_t m = 0; m < measures; ++m) {
    double sum = 0, squares = 0;
    for (const auto& set : distances) {
      sorted_[m].push_back(set[m]);
      sum += set[m];
      squares += set[m] * set[m];
    }
    std::sort(sorted_[m].begin(), sorted_[m].end());
    mean_.push_back(sum / distances.size());
    std_dev_.push_back(std::sqrt(std::max(0.0, squares / distances.size() - mean_[m] * mean_[m])));
  }
  for (const auto& set : distances) largest_.push_back(LargestStandardised(set));
  std::sort(largest_.begin(), largest_.end());
}

double PoseFreeNull::P(int measure, double distance) const {
  const auto& values = sorted_[measure];
  const auto at = std::lower_bound(values.begin(), values.end(), distance * (1 - 1e-12));
  return (1.0 + (values.end() - at)) / (1.0 + values.size());
}

// A statistic that never varies among the sets (a finger that is never first) counts only where it differs.
double PoseFreeNull::Standardised(size_t measure, double distance) const {
  const double apart = distance - mean_[measure];
  if (std_dev_[measure] > 0) return apart / std_dev_[measure];
  return apart > 1e-12 ? HUGE_VAL : -HUGE_VAL;
}

double PoseFreeNull::LargestStandardised(const std::vector<double>& distances) const {
  double largest = -HUGE_VAL;
  for (size_t m = 0; m < mean_.size(); ++m) largest = std::max(largest, Standardised(m, distances[m]));
  return largest;
}

double PoseFreeNull::Misfit(const std::vector<double>& distances) const {
  double squares = 0;
  for (size_t m = 0; m < mean_.size(); ++m) {
    const double apart = std::max(0.0, Standardised(m, distances[m]));
    squares += apart * apart;
  }
  return std::sqrt(squares);
}

double PoseFreeNull::P(const std::vector<double>& distances) const {
  const auto at = std::lower_bound(largest_.begin(), largest_.end(), LargestStandardised(distances) - 1e-12);
  return (1.0 + (largest_.end() - at)) / (1.0 + largest_.size());
}

}  // namespace touchstone::diagnosis::distributions
