#include "server/diagnosis/selection/scatter/lopsided_scatter.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "server/diagnosis/selection/scatter/rules.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kSigmaOverMedian = 1.4826;  // of absolute values, of a normal distribution

double QuantileOf(std::vector<double> values, double share) {
  const size_t at =
      std::min(values.size() - 1, static_cast<size_t>(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<long>(at), values.end());
  return values[at];
}

// Readings of one finger, or of all, against the mean of the others of their touch, and what each touch adds to the third moment.
struct Leads {
  std::vector<double> late_s, moment;

  double Z() const {
    double sum = 0, squares = 0;
    for (const double m : moment) sum += m, squares += m * m;
    return squares > 0 ? sum / std::sqrt(squares) : 0;
  }
};

Leads LeadsOf(const std::vector<touches::ReadingGroup>& groups, int finger) {
  Leads leads;
  std::vector<double> sizes;
  std::vector<size_t> touch;
  for (size_t k = 0; k < groups.size(); ++k) {
    const std::vector<double>& r = groups[k].residual_s;
    const auto own = std::find(groups[k].channel.begin(), groups[k].channel.end(), finger);
    if (r.size() < 3 || own == groups[k].channel.end()) continue;
    const double reading = r[static_cast<size_t>(own - groups[k].channel.begin())];
    const double sum = std::accumulate(r.begin(), r.end(), 0.0);
    leads.late_s.push_back(reading - (sum - reading) / static_cast<double>(r.size() - 1));
    sizes.push_back(std::abs(leads.late_s.back()));
    touch.push_back(k);
  }
  if (sizes.size() < kScatterRules.min_lopsided_readings) return {};
  const double scale_s = kSigmaOverMedian * QuantileOf(sizes, 0.5);
  if (!(scale_s > 0)) return {};
  leads.moment.assign(groups.size(), 0);
  for (size_t j = 0; j < touch.size(); ++j)
    leads.moment[touch[j]] = std::pow(std::clamp(leads.late_s[j] / scale_s, -kScatterRules.farthest.value(),
                                                 kScatterRules.farthest.value()),
                                      3);
  return leads;
}

std::optional<LopsidedScatter> Assess(const Leads& leads) {
  LopsidedScatter found;
  found.z = leads.Z();
  if (std::abs(found.z) < kScatterRules.lopsided) return std::nullopt;
  found.late_s = QuantileOf(leads.late_s, 1 - kScatterRules.outermost);
  found.early_s = -QuantileOf(leads.late_s, kScatterRules.outermost);
  const double far = found.z > 0 ? found.late_s : found.early_s, near = found.late_s + found.early_s - far;
  if (far < kScatterRules.lopsided_ratio * near) return std::nullopt;
  return found;
}

}  // namespace

std::optional<LopsidedScatter> FindLopsidedScatter(const std::vector<touches::ReadingGroup>& groups,
                                                   int fingers) {
  // One finger's late readings are early ones of the others: each by itself, and all together.
  Leads all;
  all.moment.assign(groups.size(), 0);
  std::optional<LopsidedScatter> worst;
  for (int finger = 0; finger < fingers; ++finger) {
    const Leads own = LeadsOf(groups, finger);
    if (own.late_s.empty()) continue;
    all.late_s.insert(all.late_s.end(), own.late_s.begin(), own.late_s.end());
    for (size_t k = 0; k < groups.size(); ++k) all.moment[k] += own.moment[k];
    std::optional<LopsidedScatter> found = Assess(own);
    if (found && (!worst || std::abs(found->z) > std::abs(worst->z)))
      worst = std::move(found), worst->finger = finger;
  }
  std::optional<LopsidedScatter> together = Assess(all);
  if (together && (!worst || std::abs(together->z) > std::abs(worst->z))) worst = std::move(together);
  if (!worst) return std::nullopt;
  const char* side = worst->z > 0 ? "late" : "early";
  worst->words = absl::StrFormat(
      "The times%s scatter farther to the %s side: of a hundred, two or three are more than %.2g ms late and "
      "as many more than %.2g ms early. Normal noise and heavy tails reach as far on both sides. Look for "
      "contacts that come %s now and then.",
      worst->finger < 0 ? "" : absl::StrCat(" of finger ", model::FingerName(worst->finger, fingers)), side,
      worst->late_s * 1e3, worst->early_s * 1e3, side);
  return worst;
}

}  // namespace touchstone::diagnosis::selection
