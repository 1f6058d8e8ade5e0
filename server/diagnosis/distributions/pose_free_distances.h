// How far a set without poses is from a simulated reference, by several distance measures, and how unusual
// that is.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/distributions/two_samples.h"

namespace touchstone::diagnosis::distributions {

// The touches of one object, on one side of the comparison.
struct PoseFreeSample {
  TimePoints points;
  double within_s = 0;  // MeanDistance(points, points)
  std::vector<TouchStatistic> statistics;
};
PoseFreeSample MakePoseFreeSample(const std::vector<double>& time_s, int fingers, double speed_m_s,
                                  double spacing_m);

// Distances of a set to a reference, [measure]: the energy distance (s) first, then Kolmogorov's (0 to 1) for
// every statistic; each over all objects, weighted by their touches.
std::vector<double> PoseFreeDistances(const std::vector<PoseFreeSample>& set,
                                      const std::vector<PoseFreeSample>& reference);
// Of one object.
std::vector<double> PoseFreeDistances(const PoseFreeSample& set, const PoseFreeSample& reference);

// Distribution of the distances under the null hypothesis: those of sets that the model made.
class PoseFreeNull {
 public:
  // `distances[set][measure]`.
  explicit PoseFreeNull(std::vector<std::vector<double>> distances);

  // (1 + number of sets at least as far off) / (1 + sets).
  double P(int measure, double distance) const;
  // Of all measures together: the rank of the largest standardised distance (less its mean, over its standard
  // deviation among the sets).
  double P(const std::vector<double>& distances) const;
  double LargestStandardised(const std::vector<double>& distances) const;
  // Root of the sum of squares of the positive standardised distances: smoother to search on.
  double Misfit(const std::vector<double>& distances) const;

 private:
  double Standardised(size_t measure, double distance) const;

  std::vector<std::vector<double>> sorted_;  // [measure]
  std::vector<double> mean_, std_dev_;       // [measure]
  std::vector<double> largest_;              // standardised distance of every set, sorted
};

}  // namespace touchstone::diagnosis::distributions
