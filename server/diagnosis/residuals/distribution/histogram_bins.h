// Histograms of measured and simulated values that are shown together.
#pragma once

#include <string>
#include <vector>

namespace touchstone::diagnosis::residuals {

// kDescriptor: contact times relative to the first finger's, in us. kCurvature: local curvature
// speed * (t_l - 2 t_m + t_r) / spacing^2 of three fingers, in 1/m, positive where the surface is convex.
enum class HistogramQuantity { kDescriptor, kCurvature };

struct ComparedHistogram {
  HistogramQuantity quantity = HistogramQuantity::kDescriptor;
  std::string object;         // empty: all objects
  std::vector<double> edges;  // in the quantity's unit, ascending, one more than bins
  // Densities over the bins, 1 / unit: measured, simulated by the initial and by the improved model.
  std::vector<double> measured, simulated, improved;
  // p of two-sample tests of measured against simulated and improved.
  double p_simulated = 1, p_improved = 1;
};

// Common edges for the values of all samples together: bins of the width of Freedman and Diaconis (1981),
// rounded to a readable number, over the range that holds all but the outermost thousandth at either end. At
// most DistributionRules::max_bins bins. Empty if there are no values.
std::vector<double> HistogramEdges(std::vector<double> pooled);

// Density of `values` over the bins, 1 / unit: the share of *all* values in a bin, over its width.
std::vector<double> HistogramDensity(const std::vector<double>& values, const std::vector<double>& edges);

}  // namespace touchstone::diagnosis::residuals
