#include "server/diagnosis/selection/scatter/lopsided_scatter.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kLopsidedZ = 4.4;           // two-sided p of 1e-5
constexpr double kLopsidedRatio = 1.25;      // of the two sides
constexpr double kFarthest = 4;              // scales: a single reading counts for no more
constexpr size_t kMinReadings = 120;         // of one finger
constexpr double kSigmaOverMedian = 1.4826;  // of absolute values, of a normal distribution
constexpr double kOutermost = 0.025;

// A reading against the mean of the others of its touch.
struct Lead {
  size_t touch = 0;
  double late_s = 0;
};

double QuantileOf(std::vector<double> values, double share) {
  const size_t at =
      std::min(values.size() - 1, static_cast<size_t>(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<long>(at), values.end());
  return values[at];
}

std::map<int, std::vector<Lead>> LeadsByFinger(const std::vector<touches::ReadingGroup>& groups) {
  std::map<int, std::vector<Lead>> leads;
  for (size_t k = 0; k < groups.size(); ++k) {
    const std::vector<double>& r = groups[k].residual_s;
    if (r.size() < 3) continue;
    double sum = 0;
    for (const double value : r) sum += value;
    for (size_t i = 0; i < r.size(); ++i)
      leads[groups[k].channel[i]].push_back({k, r[i] - (sum - r[i]) / static_cast<double>(r.size() - 1)});
  }
  return leads;
}

}  // namespace

std::optional<LopsidedScatter> FindLopsidedScatter(const std::vector<touches::ReadingGroup>& groups) {
  std::vector<double> moment(groups.size(), 0.0), all;
  for (const auto& [finger, leads] : LeadsByFinger(groups)) {
    if (leads.size() < kMinReadings) continue;
    std::vector<double> sizes;
    for (const Lead& lead : leads) sizes.push_back(std::abs(lead.late_s)), all.push_back(lead.late_s);
    const double scale_s = kSigmaOverMedian * QuantileOf(sizes, 0.5);
    if (!(scale_s > 0)) continue;
    for (const Lead& lead : leads)
      moment[lead.touch] += std::pow(std::clamp(lead.late_s / scale_s, -kFarthest, kFarthest), 3);
  }
  double sum = 0, squares = 0;
  for (const double m : moment) sum += m, squares += m * m;
  if (all.empty() || !(squares > 0)) return std::nullopt;
  LopsidedScatter found;
  found.z = sum / std::sqrt(squares);
  found.late_s = QuantileOf(all, 1 - kOutermost);
  found.early_s = -QuantileOf(all, kOutermost);
  const double far = found.z > 0 ? found.late_s : found.early_s, near = found.late_s + found.early_s - far;
  if (std::abs(found.z) < kLopsidedZ || far < kLopsidedRatio * near) return std::nullopt;
  found.words = absl::StrFormat(
      "The times scatter farther to the %s side: of a hundred, two or three are more than %.2g ms late and "
      "as many "
      "more than %.2g ms early. Normal noise and heavy tails reach as far on both sides. Look for contacts "
      "that "
      "come %s now and then.",
      found.z > 0 ? "late" : "early", found.late_s * 1e3, found.early_s * 1e3,
      found.z > 0 ? "late" : "early");
  return found;
}

}  // namespace touchstone::diagnosis::selection
