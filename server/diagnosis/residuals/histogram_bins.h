// Histograms of samples that are shown together.
#pragma once

#include <vector>

namespace touchstone {

inline constexpr int kMaxHistogramBins = 60;

// Common edges for all values of `samples` (each sorted here): bins of the width of Freedman and Diaconis
// (1981), rounded to a readable number, over the range that holds all but the outermost thousandth at either
// end. At most kMaxHistogramBins bins. Empty if there is nothing to show.
std::vector<double> HistogramEdges(std::vector<double> pooled);

// Density of `values` over the bins, 1 / unit: the share of *all* values in a bin, over its width.
std::vector<double> HistogramDensity(const std::vector<double>& values, const std::vector<double>& edges);

}  // namespace touchstone
