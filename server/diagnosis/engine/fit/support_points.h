// Places that stand for all others where a smooth field is to be known.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace touchstone::diagnosis::engine {

// Every point if there are at most `max_points`, else points far from one another (greedy), in that order.
std::vector<Eigen::Vector3d> SupportPoints(const std::vector<Eigen::Vector3d>& points, int max_points);

}  // namespace touchstone::diagnosis::engine
