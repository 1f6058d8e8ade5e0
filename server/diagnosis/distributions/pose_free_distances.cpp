#include "server/diagnosis/distributions/pose_free_distances.h"

#include <algorithm>
#include <cmath>

namespace touchstone {

UnposedSample MakeUnposedSample(const std::vector<double>& time_s, int fingers, double speed_m_s,
                                double spacing_m) {
  UnposedSample sample;
  sample.points = ToPoints(time_s, fingers);
  sample.within = MeanDistance(sample.points, sample.points);
  sample.statistics = TouchStatistics(time_s, fingers, speed_m_s, spacing_m);
  return sample;
}

std::vector<double> UnposedDistances(const UnposedSample& set, const UnposedSample& reference) {
  std::vector<double> distances;
  const double between = MeanDistance(set.points, reference.points);
  distances.push_back(std::max(0.0, 2 * between - set.within - reference.within));
  for (size_t s = 0; s < set.statistics.size(); ++s)
    distances.push_back(KolmogorovDistance(set.statistics[s].sorted, reference.statistics[s].sorted));
  return distances;
}

std::vector<double> UnposedDistances(const std::vector<UnposedSample>& set,
                                     const std::vector<UnposedSample>& reference) {
  std::vector<double> all;
  double touches = 0;
  for (size_t o = 0; o < set.size(); ++o) {
    const double weight = set[o].points.size();
    if (weight == 0) continue;
    const std::vector<double> distances = UnposedDistances(set[o], reference[o]);
    all.resize(distances.size(), 0);
    for (size_t m = 0; m < distances.size(); ++m) all[m] += weight * distances[m];
    touches += weight;
  }
  for (double& distance : all) distance /= touches;
  return all;
}

UnposedNull::UnposedNull(std::vector<std::vector<double>> distances) {
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
    scatter_.push_back(std::sqrt(std::max(0.0, squares / distances.size() - mean_[m] * mean_[m])));
  }
  for (const auto& set : distances) largest_.push_back(Largest(set));
  std::sort(largest_.begin(), largest_.end());
}

double UnposedNull::P(int measure, double distance) const {
  const auto& values = sorted_[measure];
  const auto at = std::lower_bound(values.begin(), values.end(), distance * (1 - 1e-12));
  return (1.0 + (values.end() - at)) / (1.0 + values.size());
}

// A statistic that never varies (a finger that is never first) speaks only where it does.
double UnposedNull::InScatters(size_t measure, double distance) const {
  const double apart = distance - mean_[measure];
  if (scatter_[measure] > 0) return apart / scatter_[measure];
  return apart > 1e-12 ? HUGE_VAL : -HUGE_VAL;
}

double UnposedNull::Largest(const std::vector<double>& distances) const {
  double largest = -HUGE_VAL;
  for (size_t m = 0; m < mean_.size(); ++m) largest = std::max(largest, InScatters(m, distances[m]));
  return largest;
}

double UnposedNull::Together(const std::vector<double>& distances) const {
  double squares = 0;
  for (size_t m = 0; m < mean_.size(); ++m) {
    const double apart = std::max(0.0, InScatters(m, distances[m]));
    squares += apart * apart;
  }
  return std::sqrt(squares);
}

double UnposedNull::P(const std::vector<double>& distances) const {
  const auto at = std::lower_bound(largest_.begin(), largest_.end(), Largest(distances) - 1e-12);
  return (1.0 + (largest_.end() - at)) / (1.0 + largest_.size());
}

}  // namespace touchstone
