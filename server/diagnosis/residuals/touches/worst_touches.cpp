#include "server/diagnosis/residuals/touches/worst_touches.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/residuals/slices/covariates.h"
#include "server/diagnosis/residuals/touches/rules.h"

namespace touchstone::diagnosis::residuals {

std::vector<WorstTouch> FindWorstTouches(const touches::Observations& observations,
                                         const std::vector<double>& residuals) {
  const int fingers = observations.fingers;
  std::vector<int> touches;
  std::vector<double> norm2(observations.size(), 0);
  for (int k = 0; k < observations.size(); ++k) {
    if (!observations.used[k] || FingersCompared(observations, residuals, k) < 2) continue;
    touches.push_back(k);
    for (int i = 0; i < fingers; ++i) {
      const double residual_s = residuals[size_t(k) * fingers + i];
      if (!std::isnan(residual_s)) norm2[k] += residual_s * residual_s;
    }
  }
  const size_t count = std::min(kTouchResidualRules.max_worst.value(), touches.size());
  std::partial_sort(touches.begin(), touches.begin() + count, touches.end(),
                    [&](int a, int b) { return norm2[a] != norm2[b] ? norm2[a] > norm2[b] : a < b; });
  std::vector<WorstTouch> worst;
  for (size_t n = 0; n < count; ++n) {
    const int k = touches[n];
    const auto first = residuals.begin() + static_cast<long>(k) * fingers;
    worst.push_back({observations.set->touch[observations.row[k]],
                     observations.objects[observations.object[k]],
                     std::vector<double>(first, first + fingers), std::sqrt(norm2[k])});
  }
  return worst;
}

}  // namespace touchstone::diagnosis::residuals
