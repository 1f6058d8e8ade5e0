#include "server/diagnosis/engine/fit/support_points.h"

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::engine {

std::vector<Eigen::Vector3d> SupportPoints(const std::vector<Eigen::Vector3d>& points, int max_points) {
  if (static_cast<int>(points.size()) <= max_points) return points;
  std::vector<Eigen::Vector3d> chosen = {points[0]};
  std::vector<double> nearest(points.size(), INFINITY);
  while (static_cast<int>(chosen.size()) < max_points) {
    size_t farthest = 0;
    for (size_t k = 0; k < points.size(); ++k) {
      nearest[k] = std::min(nearest[k], (points[k] - chosen.back()).squaredNorm());
      if (nearest[k] > nearest[farthest]) farthest = k;
    }
    if (nearest[farthest] <= 0) break;
    chosen.push_back(points[farthest]);
  }
  return chosen;
}

}  // namespace touchstone::diagnosis::engine
