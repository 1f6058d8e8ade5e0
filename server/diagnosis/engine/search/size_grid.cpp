#include "server/diagnosis/engine/search/size_grid.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/engine/search/rules.h"

namespace touchstone::diagnosis::engine {

double Reach(const FreeParameter& p, double* sign) {
  *sign = p.upper - p.neutral >= p.neutral - p.lower ? 1 : -1;
  const double bound = *sign > 0 ? p.upper - p.neutral : p.neutral - p.lower;
  return p.reciprocal ? bound : std::min(bound, kCandidateRules.max_over_typical * p.scale);
}

std::vector<double> SizesOnGrid(const FreeParameter& parameter) {
  double sign = 1;
  const double reach = Reach(parameter, &sign);
  std::vector<double> sizes;
  for (double size = kCandidateRules.min_over_typical * parameter.scale; size < reach;
       size *= kCandidateRules.grid_factor)
    sizes.push_back(size);
  if (reach > 0) sizes.push_back(reach);
  return sizes;
}

}  // namespace touchstone::diagnosis::engine
