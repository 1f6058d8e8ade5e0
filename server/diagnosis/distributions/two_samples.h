// Distances between two samples of touches of which only the times are known.
#pragma once

#include <string>
#include <vector>

namespace touchstone::diagnosis::distributions {

// Touches as points: only differences between a touch's times are known, so n times become n - 1 numbers,
// their orthonormal contrasts (Helmert's). Euclidean distances between points are those between the times
// less their means.
struct TimePoints {
  int dimensions = 0;
  std::vector<double> value;  // [point * dimensions + d], s
  int size() const { return dimensions == 0 ? 0 : static_cast<int>(value.size()) / dimensions; }
};

// `time_s` [touch * fingers + finger]; touches with a missing time are left out.
TimePoints ToPoints(const std::vector<double>& time_s, int fingers);

// Mean distance between a point of `a` and one of `b`; for a sample and itself among all ordered pairs, equal
// ones included. 0 if one is empty.
double MeanDistance(const TimePoints& a, const TimePoints& b);

// Energy distance (Szekely and Rizzo 2013): 2 E|X-Y| - E|X-X'| - E|Y-Y'|, at least 0, seconds. `within_b` is
// MeanDistance(b, b), for callers that compare many samples with one.
double EnergyDistance(const TimePoints& a, const TimePoints& b, double within_b);

// Largest gap between the cumulative distributions of two sorted samples, 0 to 1.
double KolmogorovDistance(const std::vector<double>& sorted_a, const std::vector<double>& sorted_b);

// The name of the statistic of local curvature.
inline constexpr char kCurvatureStatistic[] = "curvature_per_m";

// A number that people can picture, of every complete touch of a sample.
struct TouchStatistic {
  std::string name;
  std::string unit;            // of the values: "us", "1/m", or empty for yes (1) and no (0)
  std::vector<double> sorted;  // ascending
  double Mean() const;
};

// Spread between first and last finger, the middle finger's lead or the local curvature (three fingers), the
// last finger's delay against the first, the gap between the two earliest, and how often each finger is
// first.
std::vector<TouchStatistic> TouchStatistics(const std::vector<double>& time_s, int fingers, double speed_m_s,
                                            double spacing_m);

}  // namespace touchstone::diagnosis::distributions
