#include "server/diagnosis/residuals/distribution/parity.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/residuals/distribution/rules.h"

namespace touchstone::diagnosis::residuals {

std::vector<ParityPoint> MakeParity(const touches::Observations& observations,
                                    const touches::Prediction& initial, const std::vector<double>& before,
                                    const std::vector<double>& after) {
  const int fingers = observations.fingers;
  std::vector<size_t> cells;
  for (int k = 0; k < observations.size(); ++k)
    if (observations.used[k])
      for (int i = 0; i < fingers; ++i)
        if (!std::isnan(before[size_t(k) * fingers + i])) cells.push_back(size_t(k) * fingers + i);
  const size_t count = std::min(kDistributionRules.max_parity_points.value(), cells.size());
  std::vector<ParityPoint> points;
  for (size_t n = 0; n < count; ++n) {
    // Evenly over the session; the finger changes from point to point.
    const size_t cell = cells[cells.size() * n / count];
    const size_t first = cell / fingers * fingers;
    double mean_s = 0, compared = 0;
    for (size_t c = first; c < first + fingers; ++c)
      if (!std::isnan(before[c])) mean_s += initial.time_s[c], compared += 1;
    const double simulated_s = initial.time_s[cell] - mean_s / compared;
    ParityPoint point;
    point.simulated_s = simulated_s;
    point.measured_s = simulated_s + before[cell];
    point.improved_s = simulated_s + before[cell] - (std::isnan(after[cell]) ? before[cell] : after[cell]);
    point.finger = static_cast<int>(cell % fingers);
    points.push_back(point);
  }
  return points;
}

}  // namespace touchstone::diagnosis::residuals
