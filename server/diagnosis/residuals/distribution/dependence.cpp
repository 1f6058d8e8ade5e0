#include "server/diagnosis/residuals/distribution/dependence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/numbers/random.h"
#include "server/diagnosis/residuals/distribution/permutation.h"
#include "server/diagnosis/residuals/distribution/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// What changes places as a whole: a pose with all of its repeats, or one touch. Bin (-1: none) and residual
// (NaN: none) of each finger.
struct Exchangeable {
  std::vector<int> bin;
  std::vector<double> residual_s;
};

struct ExchangeableUnits {
  std::vector<Exchangeable> units;
  std::vector<std::pair<int, int>> blocks;  // [begin, end): within which units may change places
};

// Calls body(begin, end) for the cells of every pose.
template <typename Body>
void ForPoses(const std::vector<ResidualCell>& cells, int max_poses, const Body& body) {
  int poses = 0;
  for (size_t begin = 0; begin < cells.size() && poses < max_poses; ++poses) {
    size_t end = begin;
    while (end < cells.size() && cells[end].pose == cells[begin].pose) ++end;
    body(begin, end);
    begin = end;
  }
}

bool VariesWithinPoses(const std::vector<ResidualCell>& cells, int fingers) {
  double all_sum = 0, all_squares = 0, within = 0;
  ForPoses(cells, static_cast<int>(cells.size()), [&](size_t begin, size_t end) {
    std::vector<double> sum(fingers, 0), squares(fingers, 0), count(fingers, 0);
    for (size_t c = begin; c < end; ++c) {
      const double value = cells[c].covariate;
      count[cells[c].finger] += 1, sum[cells[c].finger] += value;
      squares[cells[c].finger] += value * value;
      all_sum += value, all_squares += value * value;
    }
    for (int i = 0; i < fingers; ++i)
      if (count[i] > 0) within += squares[i] - sum[i] * sum[i] / count[i];
  });
  const double all = all_squares - all_sum * all_sum / std::max<size_t>(1, cells.size());
  return within > kDistributionRules.within_poses * all;
}

// Means of the fingers over one pose; NaN for a finger without cells.
struct PoseMeans {
  std::vector<double> residual_s, covariate, count;
};

PoseMeans MeansOf(const std::vector<ResidualCell>& cells, size_t begin, size_t end, int fingers) {
  PoseMeans means{std::vector<double>(fingers, 0), std::vector<double>(fingers, 0),
                  std::vector<double>(fingers, 0)};
  for (size_t c = begin; c < end; ++c) {
    means.residual_s[cells[c].finger] += cells[c].before_s;
    means.covariate[cells[c].finger] += cells[c].covariate;
    means.count[cells[c].finger] += 1;
  }
  for (int i = 0; i < fingers; ++i)
    means.residual_s[i] /= means.count[i], means.covariate[i] /= means.count[i];
  return means;
}

// Poses as units, all in one block; the mean of every finger over all poses is removed.
ExchangeableUnits PosesAsUnits(const std::vector<ResidualCell>& cells, const std::vector<double>& ends,
                               int fingers) {
  ExchangeableUnits result;
  ForPoses(cells, static_cast<int>(kDistributionRules.max_poses.value()), [&](size_t begin, size_t end) {
    const PoseMeans means = MeansOf(cells, begin, end, fingers);
    result.units.push_back({std::vector<int>(fingers, -1), means.residual_s});
    for (int i = 0; i < fingers; ++i)
      if (means.count[i] > 0) result.units.back().bin[i] = BinOf(ends, means.covariate[i]);
  });
  result.blocks.emplace_back(0, static_cast<int>(result.units.size()));
  for (int i = 0; i < fingers; ++i) {
    double sum = 0, count = 0;
    for (const Exchangeable& unit : result.units)
      if (!std::isnan(unit.residual_s[i])) sum += unit.residual_s[i], count += 1;
    for (Exchangeable& unit : result.units) unit.residual_s[i] -= sum / count;
  }
  return result;
}

// Touches as units, a block per pose; the mean of every finger over the pose is removed.
ExchangeableUnits TouchesAsUnits(const std::vector<ResidualCell>& cells, const std::vector<double>& ends,
                                 int fingers) {
  ExchangeableUnits result;
  ForPoses(cells, static_cast<int>(kDistributionRules.max_poses.value()), [&](size_t begin, size_t end) {
    const PoseMeans means = MeansOf(cells, begin, end, fingers);
    const int first_unit = static_cast<int>(result.units.size());
    for (size_t c = begin; c < end; ++c) {
      if (c == begin || cells[c].touch != cells[c - 1].touch)
        result.units.push_back({std::vector<int>(fingers, -1), std::vector<double>(fingers, NAN)});
      const int finger = cells[c].finger;
      result.units.back().bin[finger] = BinOf(ends, cells[c].covariate);
      result.units.back().residual_s[finger] = cells[c].before_s - means.residual_s[finger];
    }
    result.blocks.emplace_back(first_unit, static_cast<int>(result.units.size()));
  });
  return result;
}

// Between-bin sum of squares, all fingers, with the residuals of unit source[u] in the bins of unit u. `sums`
// is working memory.
double BetweenBinSquares(const std::vector<Exchangeable>& units, const std::vector<int>& source, int fingers,
                         int bins, std::vector<double>* sums) {
  sums->assign(2 * static_cast<size_t>(fingers) * bins, 0);
  double* const count = sums->data();
  double* const sum = count + static_cast<size_t>(fingers) * bins;
  for (size_t u = 0; u < units.size(); ++u) {
    const Exchangeable& place = units[u];
    const Exchangeable& occupant = units[source[u]];
    for (int i = 0; i < fingers; ++i) {
      if (place.bin[i] < 0 || std::isnan(occupant.residual_s[i])) continue;
      count[i * bins + place.bin[i]] += 1;
      sum[i * bins + place.bin[i]] += occupant.residual_s[i];
    }
  }
  double between = 0;
  for (int c = 0; c < fingers * bins; ++c)
    if (count[c] > 0) between += sum[c] * sum[c] / count[c];
  return between;
}

}  // namespace

int BinOf(const std::vector<double>& ends, double value) {
  const auto at = std::lower_bound(ends.begin(), ends.end(), value) - ends.begin();
  return static_cast<int>(std::min<size_t>(at, ends.size() - 1));
}

double DependenceP(const std::vector<ResidualCell>& cells, const std::vector<double>& ends, int fingers,
                   uint64_t seed, int number) {
  const int bins = static_cast<int>(ends.size());
  const auto [units, blocks] = VariesWithinPoses(cells, fingers) ? TouchesAsUnits(cells, ends, fingers)
                                                                 : PosesAsUnits(cells, ends, fingers);
  std::vector<int> source(units.size());
  for (size_t u = 0; u < units.size(); ++u) source[u] = static_cast<int>(u);
  std::vector<double> sums;
  const double observed = BetweenBinSquares(units, source, fingers, bins, &sums);
  RandomStream random(seed, RandomDomain::kDiagnosis, number, 3);
  std::vector<double> permuted(kDistributionRules.dependence_permutations.value());
  for (double& value : permuted) {
    for (const auto& [begin, end] : blocks)
      for (int u = end - 1; u > begin; --u) std::swap(source[u], source[begin + random.Below(u - begin + 1)]);
    value = BetweenBinSquares(units, source, fingers, bins, &sums);
  }
  return PermutationP(observed, permuted);
}

}  // namespace touchstone::diagnosis::residuals
