#include "server/diagnosis/residuals/touches/finger_scatter.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <vector>

#include "server/diagnosis/residuals/slices/covariates.h"
#include "server/diagnosis/residuals/touches/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

constexpr size_t kBlocks[] = {80, 40, 20};  // of neighbours in time

// Sums over the touches in which all fingers reported.
struct ScatterSums {
  double touches = 0, own = 0, others = 0;  // squares, s^2, per degree of freedom
  std::map<int, double> apart;              // by pose
  std::vector<double> in_order;             // of each touch, in the order of the session

  // Of the sum over all touches: as repeats of a pose share an error, and as neighbours in time do.
  double Variance() const {
    double variance = 0;
    for (const auto& [pose, sum] : apart) variance += sum * sum;
    const double mean = std::accumulate(in_order.begin(), in_order.end(), 0.0) / touches;
    for (const size_t blocks : kBlocks) {
      if (in_order.size() < 2 * blocks) continue;
      double squares = 0;
      for (size_t b = 0; b < blocks; ++b) {
        double sum = 0;
        for (size_t j = in_order.size() * b / blocks; j < in_order.size() * (b + 1) / blocks; ++j)
          sum += in_order[j] - mean;
        squares += sum * sum;
      }
      variance = std::max(variance, squares * blocks / (blocks - 1.0));
    }
    return variance;
  }
};

ScatterSums SumSquares(const touches::Observations& o, const std::vector<double>& residuals, int finger) {
  ScatterSums sums;
  const double dof = 1 - 1.0 / o.fingers;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k] || FingersCompared(o, residuals, k) < o.fingers) continue;
    double own = 0, others = 0;
    for (int i = 0; i < o.fingers; ++i) {
      const double residual_s = residuals[static_cast<size_t>(k) * o.fingers + i];
      (i == finger ? own : others) += residual_s * residual_s / dof;
    }
    others /= o.fingers - 1;
    sums.touches += 1, sums.own += own, sums.others += others;
    sums.apart[o.pose[k]] += own - others;
    sums.in_order.push_back(own - others);
  }
  return sums;
}

}  // namespace

std::optional<FingerScatter> FindFingerScatter(const touches::Observations& o,
                                               const std::vector<double>& residuals) {
  if (o.fingers < 3) return std::nullopt;
  std::optional<FingerScatter> found;
  double largest = 0;
  for (int i = 0; i < o.fingers; ++i) {
    const ScatterSums sums = SumSquares(o, residuals, i);
    if (static_cast<int>(sums.apart.size()) < kTouchResidualRules.min_finger_poses || !(sums.others > 0))
      continue;
    const double ratio = std::sqrt(sums.own / sums.others);
    const double z = std::abs(sums.own - sums.others) / std::sqrt(sums.Variance());
    const double p = std::min(1.0, o.fingers * std::erfc(z / std::sqrt(2.0)));
    if (p > kTouchResidualRules.max_finger_p ||
        std::abs(std::log(ratio)) < std::log1p(kTouchResidualRules.min_finger_difference.value()))
      continue;
    if (std::abs(std::log(ratio)) <= largest) continue;
    largest = std::abs(std::log(ratio));
    found = {i, std::sqrt(sums.own / sums.touches), std::sqrt(sums.others / sums.touches), p};
  }
  return found;
}

}  // namespace touchstone::diagnosis::residuals
