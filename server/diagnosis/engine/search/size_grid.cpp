#include "server/diagnosis/engine/search/size_grid.h"

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kMaxOverTypical = 20;  // sizes over what rigs show
constexpr double kSmallestOverTypical = 0.2;
constexpr double kGridFactor = 1.5;

}  // namespace

double Reach(const FreeParameter& p, double* sign) {
  *sign = p.upper - p.neutral >= p.neutral - p.lower ? 1 : -1;
  const double bound = *sign > 0 ? p.upper - p.neutral : p.neutral - p.lower;
  return p.reciprocal ? bound : std::min(bound, kMaxOverTypical * p.scale);
}

std::vector<double> SizesOnGrid(const FreeParameter& parameter) {
  double sign = 1;
  const double reach = Reach(parameter, &sign);
  std::vector<double> sizes;
  for (double size = kSmallestOverTypical * parameter.scale; size < reach; size *= kGridFactor)
    sizes.push_back(size);
  if (reach > 0) sizes.push_back(reach);
  return sizes;
}

}  // namespace touchstone::diagnosis::engine
