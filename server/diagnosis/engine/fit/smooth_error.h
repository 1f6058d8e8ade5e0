// Where a smooth error of a group's surface enters the rows.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace touchstone::diagnosis::engine {

// A bump of height h at `position_m` adds h * row_per_m[j] to row first_row + j.
struct SmoothErrorSite {
  Eigen::Vector3d position_m;
  int first_row = 0;
  std::vector<double> row_per_m;
};

struct SmoothErrorGeometry {
  std::vector<std::vector<SmoothErrorSite>> sites;       // by group, in the order of the rows
  std::vector<std::vector<Eigen::Vector3d>> distinct_m;  // by group: positions without repeats
  double size_m = 0;          // mean longest side of the groups' surfaces: scale of correlation lengths
  double mean_row_per_m = 0;  // mean size of a reading's response: scale of amplitudes
};

}  // namespace touchstone::diagnosis::engine
