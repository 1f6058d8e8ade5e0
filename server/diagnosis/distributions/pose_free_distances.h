// How far a set without poses is from a simulated reference, by several measures, and how unusual that is.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/distributions/two_samples.h"

namespace touchstone {

// What one side of the comparison is made of, an object each.
struct UnposedSample {
  TimePoints points;
  double within = 0;  // MeanDistance(points, points)
  std::vector<TouchStatistic> statistics;
};
UnposedSample MakeUnposedSample(const std::vector<double>& time_s, int fingers, double speed_m_s,
                                double spacing_m);

// Distances of a set to a reference: the energy distance first, then Kolmogorov's for every statistic; each
// over all objects, weighted by their touches.
std::vector<double> UnposedDistances(const std::vector<UnposedSample>& set,
                                     const std::vector<UnposedSample>& reference);
// Of one object.
std::vector<double> UnposedDistances(const UnposedSample& set, const UnposedSample& reference);

// Ranks among sets that the model made.
class UnposedNull {
 public:
  // `distances[set][measure]`.
  explicit UnposedNull(std::vector<std::vector<double>> distances);

  // (1 + how many sets lie at least so far off) / (1 + sets).
  double P(int measure, double distance) const;
  // Of all measures together: the rank of the largest distance, each in units of its scatter among the sets.
  double P(const std::vector<double>& distances) const;
  double Largest(const std::vector<double>& distances) const;
  // Root of the sum of squares of what all measures are too large, in the same units: smoother to search on.
  double Together(const std::vector<double>& distances) const;

 private:
  double InScatters(size_t measure, double distance) const;

  std::vector<std::vector<double>> sorted_;  // [measure]
  std::vector<double> mean_, scatter_;       // a measure
  std::vector<double> largest_;              // of every set, sorted
};

}  // namespace touchstone
