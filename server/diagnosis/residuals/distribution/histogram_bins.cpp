#include "server/diagnosis/residuals/distribution/histogram_bins.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/residuals/distribution/rules.h"

namespace touchstone::diagnosis::residuals {

std::vector<double> HistogramEdges(std::vector<double> pooled) {
  if (pooled.empty()) return {};
  std::sort(pooled.begin(), pooled.end());
  const size_t last = pooled.size() - 1;
  const auto quantile = [&](double q) { return pooled[static_cast<size_t>(std::lround(q * last))]; };
  const double low = quantile(0.001), high = quantile(0.999);
  const double size = std::max(std::abs(low), std::abs(high));
  if (high - low <= 1e-12 * size) {
    const double half = size > 0 ? 1e-3 * size : 0.5;  // all values equal: one bin around them
    return {low - half, high + half};
  }
  double width = 2 * (quantile(0.75) - quantile(0.25)) / std::cbrt(static_cast<double>(pooled.size()));
  // Two bins are kept for the rounding outwards.
  width = std::max(width, (high - low) / (kDistributionRules.max_bins - 2));
  const double power = std::pow(10, std::floor(std::log10(width)));
  double step = 10 * power;
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * power >= width * (1 - 1e-9)) step = factor * power;
  const double first = std::floor(low / step);
  const int bins = std::max(1, static_cast<int>(std::ceil(high / step - 1e-9) - first));
  std::vector<double> edges;
  for (int b = 0; b <= bins; ++b) edges.push_back((first + b) * step);
  return edges;
}

std::vector<double> HistogramDensity(const std::vector<double>& values, const std::vector<double>& edges) {
  if (edges.size() < 2) return {};
  std::vector<double> density(edges.size() - 1, 0);
  const double width = edges[1] - edges[0];
  for (const double value : values) {
    const double at = (value - edges.front()) / width;
    if (!(value >= edges.front() && value <= edges.back())) continue;
    density[std::min(density.size() - 1, static_cast<size_t>(at))] += 1;
  }
  for (double& d : density) d /= width * values.size();
  return density;
}

}  // namespace touchstone::diagnosis::residuals
