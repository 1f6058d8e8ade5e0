#include "server/diagnosis/residuals/distribution/permutation.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/diagnosis/residuals/distribution/rules.h"
#include "server/diagnosis/residuals/rules.h"

namespace touchstone::diagnosis::residuals {

double ChiSquareTail(double x, double dof) {
  if (x <= 0) return 1;
  const double step = 2 / (9 * dof);
  const double z = (std::cbrt(x / dof) - (1 - step)) / std::sqrt(step);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

double PermutationP(double observed, const std::vector<double>& permuted) {
  const double count = permuted.size();
  double as_large = 0, sum = 0, squares = 0;
  for (const double value : permuted) {
    // Values that differ by rounding only count as equal.
    as_large += value >= observed * (1 - 1e-12);
    sum += value;
    squares += value * value;
  }
  const double p = (1 + as_large) / (1 + count);
  if (as_large > 0 || count < 20) return p;
  const double mean = sum / count, variance = (squares - sum * mean) / (count - 1);
  if (!(variance > 0) || !(mean > 0)) return p;
  // a * chi^2_d has mean a d and variance 2 a^2 d.
  const double dof = 2 * mean * mean / variance, factor = variance / (2 * mean);
  return std::min(p, ChiSquareTail(observed / factor, dof));
}

double PosePermutationP(const std::vector<double>& a, const std::vector<double>& b,
                        const std::vector<int>& pose, uint64_t seed, uint64_t number) {
  if (a.empty()) return 1;
  std::vector<double> pooled = a;
  pooled.insert(pooled.end(), b.begin(), b.end());
  std::sort(pooled.begin(), pooled.end());
  std::vector<double> ends;
  for (int r = 1; r < kDistributionRules.ranks; ++r)
    ends.push_back(pooled[pooled.size() * r / kDistributionRules.ranks]);
  const auto rank = [&](double value) {
    return static_cast<int>(std::upper_bound(ends.begin(), ends.end(), value) - ends.begin());
  };

  // Values in the order of their poses, with where each pose ends.
  struct Pair {
    int pose, a, b;
  };
  std::vector<Pair> pairs;
  for (size_t n = 0; n < a.size(); ++n) pairs.push_back({pose[n], rank(a[n]), rank(b[n])});
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) { return x.pose < y.pose; });
  std::vector<size_t> pose_end;
  for (size_t n = 1; n <= pairs.size(); ++n)
    if (n == pairs.size() || pairs[n].pose != pairs[n - 1].pose) pose_end.push_back(n);
  if (pose_end.size() > kDistributionRules.max_poses) pose_end.resize(kDistributionRules.max_poses);

  std::vector<int> difference(kDistributionRules.ranks.value());
  const auto gap = [&](auto sign) {
    std::fill(difference.begin(), difference.end(), 0);
    size_t n = 0;
    for (const size_t end : pose_end) {
      const int s = sign();
      for (; n < end; ++n) difference[pairs[n].a] += s, difference[pairs[n].b] -= s;
    }
    double sum = 0, squares = 0;
    for (const int d : difference) sum += d, squares += sum * sum;
    return squares;
  };
  const double observed = gap([] { return 1; });
  RandomStream random(seed, RandomDomain::kDiagnosis, number, 5);
  std::vector<double> permuted(kResidualRules.permutations.value());
  for (double& value : permuted) {
    uint64_t bits = 0;
    int left = 0;
    value = gap([&] {
      if (left == 0) bits = random.Word(), left = 64;
      --left;
      const int s = bits & 1 ? 1 : -1;
      bits >>= 1;
      return s;
    });
  }
  return PermutationP(observed, permuted);
}

}  // namespace touchstone::diagnosis::residuals
