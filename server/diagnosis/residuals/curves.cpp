// Residual against every covariate: a curve a finger, and whether there is any dependence at all.
#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/diagnosis/residuals/covariates.h"
#include "server/diagnosis/residuals/describe_residuals.h"
#include "server/diagnosis/residuals/permutation.h"

namespace touchstone {
namespace {

constexpr int kBins = 12;
constexpr int kMaxTouches = 60000;
constexpr int kMaxPosesPermuted = 20000;
constexpr int kPermutations = 200;

// One finger of one touch.
struct Cell {
  int touch, pose, finger;
  double value, before_s, after_s;
};

// Upper ends of bins that hold equally many cells; categories have a bin each.
std::vector<double> BinEnds(const ResidualCovariate& covariate, std::vector<double> values) {
  std::vector<double> ends;
  if (covariate.is_category()) {
    for (size_t b = 0; b < covariate.labels.size(); ++b) ends.push_back(b + 0.5);
    return ends;
  }
  std::sort(values.begin(), values.end());
  for (int b = 1; b <= kBins && !values.empty(); ++b) {
    const double end = values[std::min(values.size() - 1, values.size() * b / kBins)];
    if (ends.empty() || end > ends.back()) ends.push_back(end);
  }
  return ends;
}

int BinOf(const std::vector<double>& ends, double value) {
  const auto at = std::lower_bound(ends.begin(), ends.end(), value) - ends.begin();
  return static_cast<int>(std::min<size_t>(at, ends.size() - 1));
}

// A group of cells that changes places as a whole: a pose with all of its repeats, or one touch. Its bins and
// residuals, a finger; bin -1 where there is nothing.
struct Unit {
  std::vector<int> bin;
  std::vector<double> residual_s;
};

// Between-bin sum of squares of the residuals `residual[unit]` over the bins of `units`, all fingers.
double Dependence(const std::vector<Unit>& units, const std::vector<int>& source, int fingers, int bins,
                  std::vector<double>* sums) {
  sums->assign(2 * static_cast<size_t>(fingers) * bins, 0);
  double* const count = sums->data();
  double* const sum = count + static_cast<size_t>(fingers) * bins;
  for (size_t u = 0; u < units.size(); ++u) {
    const Unit& place = units[u];
    const Unit& what = units[source[u]];
    for (int i = 0; i < fingers; ++i) {
      if (place.bin[i] < 0 || std::isnan(what.residual_s[i])) continue;
      count[i * bins + place.bin[i]] += 1;
      sum[i * bins + place.bin[i]] += what.residual_s[i];
    }
  }
  double between = 0;
  for (int c = 0; c < fingers * bins; ++c)
    if (count[c] > 0) between += sum[c] * sum[c] / count[c];
  return between;
}

class CurveMaker {
 public:
  CurveMaker(const Observations& observations, const std::vector<double>& before,
             const std::vector<double>& after, uint64_t seed)
      : observations_(observations),
        before_(before),
        after_(after),
        seed_(seed),
        touches_(ThinnedTouches(observations, before, kMaxTouches)) {
    // Touches of one pose side by side: so are the cells that are made from them.
    std::stable_sort(touches_.begin(), touches_.end(),
                     [&](int a, int b) { return observations.pose[a] < observations.pose[b]; });
  }

  void Make(const ResidualCovariate& covariate, int number, int covariates, v1::CovariateCurve* curve) const;

 private:
  void AddBins(const std::vector<Cell>& cells, const std::vector<double>& ends, int finger,
               v1::CovariateCurve* curve) const;
  double Test(const std::vector<Cell>& cells, const std::vector<double>& ends, int number) const;

  const Observations& observations_;
  const std::vector<double>& before_;
  const std::vector<double>& after_;
  const uint64_t seed_;
  std::vector<int> touches_;
};

void CurveMaker::Make(const ResidualCovariate& covariate, int number, int covariates,
                      v1::CovariateCurve* curve) const {
  std::vector<Cell> cells;
  std::vector<double> values;
  for (const int k : touches_) {
    for (int i = 0; i < observations_.fingers; ++i) {
      const size_t at = size_t(k) * observations_.fingers + i;
      const double value = covariate.value(k, i);
      if (std::isnan(before_[at]) || std::isnan(value)) continue;
      cells.push_back({k, observations_.pose[k], i, value, before_[at], after_[at]});
      values.push_back(value);
    }
  }
  const std::vector<double> ends = BinEnds(covariate, std::move(values));
  curve->set_covariate(covariate.name);
  curve->set_unit(covariate.unit);
  if (ends.size() < 2) {
    curve->set_p(1);
    return;
  }
  for (int i = 0; i < observations_.fingers; ++i) AddBins(cells, ends, i, curve);
  // Whoever looks at many curves finds one that bends by chance.
  curve->set_p(std::min(1.0, covariates * Test(cells, ends, number)));
}

void CurveMaker::AddBins(const std::vector<Cell>& cells, const std::vector<double>& ends, int finger,
                         v1::CovariateCurve* curve) const {
  struct Bin {
    double count = 0, value = 0, before = 0, after = 0, after_count = 0, scatter = 0;
    double pose_sum = 0, pose_count = 0;
    int poses = 0;
  };
  std::vector<Bin> bins(ends.size());
  for (const Cell& cell : cells) {
    if (cell.finger != finger) continue;
    Bin& bin = bins[BinOf(ends, cell.value)];
    bin.count += 1;
    bin.value += cell.value;
    bin.before += cell.before_s;
    if (!std::isnan(cell.after_s)) bin.after += cell.after_s, bin.after_count += 1;
  }
  // Repeats of a pose share whatever the model gets wrong there: the poses are what is independent.
  std::vector<int> pose(ends.size(), -1);
  const auto close = [&](size_t b) {
    Bin& bin = bins[b];
    if (bin.pose_count == 0) return;
    const double apart = bin.pose_sum - bin.pose_count * bin.before / bin.count;
    bin.scatter += apart * apart;
    ++bin.poses;
    bin.pose_sum = bin.pose_count = 0;
  };
  for (const Cell& cell : cells) {
    if (cell.finger != finger) continue;
    const int b = BinOf(ends, cell.value);
    if (pose[b] != cell.pose) close(b);
    pose[b] = cell.pose;
    bins[b].pose_sum += cell.before_s;
    bins[b].pose_count += 1;
  }
  for (size_t b = 0; b < bins.size(); ++b) {
    close(b);
    const Bin& bin = bins[b];
    if (bin.count == 0) continue;
    v1::CurveBin* message = curve->add_bins();
    message->set_finger(FingerName(finger, observations_.fingers));
    message->set_centre(bin.value / bin.count);
    message->set_count(static_cast<uint32_t>(bin.count));
    message->set_mean_residual_us(bin.before / bin.count * 1e6);
    message->set_after_us(bin.after_count ? bin.after / bin.after_count * 1e6 : 0);
    if (bin.poses > 1)
      message->set_std_error_us(std::sqrt(bin.scatter * bin.poses / (bin.poses - 1)) / bin.count * 1e6);
  }
}

// Under the hypothesis that the residual does not hang on the covariate, poses may change places. A covariate
// that changes among the repeats of a pose (time, the press before) is tested there: what the pose does is
// taken out, and the touches of a pose change places.
double CurveMaker::Test(const std::vector<Cell>& cells, const std::vector<double>& ends, int number) const {
  const int fingers = observations_.fingers, bins = static_cast<int>(ends.size());

  // Does it change within poses?
  double all_sum = 0, all_squares = 0, within = 0;
  for (size_t begin = 0; begin < cells.size();) {
    size_t end = begin;
    std::vector<double> sum(fingers, 0), squares(fingers, 0), count(fingers, 0);
    for (; end < cells.size() && cells[end].pose == cells[begin].pose; ++end) {
      const Cell& cell = cells[end];
      count[cell.finger] += 1, sum[cell.finger] += cell.value;
      squares[cell.finger] += cell.value * cell.value;
      all_sum += cell.value, all_squares += cell.value * cell.value;
    }
    for (int i = 0; i < fingers; ++i)
      if (count[i] > 0) within += squares[i] - sum[i] * sum[i] / count[i];
    begin = end;
  }
  const double all = all_squares - all_sum * all_sum / std::max<size_t>(1, cells.size());
  const bool inside = within > 0.25 * all;

  // The units, and which of them may change places.
  std::vector<Unit> units;
  std::vector<std::pair<int, int>> blocks;  // begin, end
  int poses = 0;
  for (size_t begin = 0; begin < cells.size() && poses < kMaxPosesPermuted; ++poses) {
    size_t end = begin;
    std::vector<double> mean(fingers, 0), count(fingers, 0), value(fingers, 0);
    for (; end < cells.size() && cells[end].pose == cells[begin].pose; ++end) {
      mean[cells[end].finger] += cells[end].before_s;
      value[cells[end].finger] += cells[end].value;
      count[cells[end].finger] += 1;
    }
    for (int i = 0; i < fingers; ++i) mean[i] /= count[i], value[i] /= count[i];  // NaN without any
    const int first_unit = static_cast<int>(units.size());
    if (!inside) {
      units.push_back({std::vector<int>(fingers, -1), mean});
      for (int i = 0; i < fingers; ++i)
        if (count[i] > 0) units.back().bin[i] = BinOf(ends, value[i]);
    } else {
      for (size_t c = begin; c < end; ++c) {
        if (c == begin || cells[c].touch != cells[c - 1].touch)
          units.push_back({std::vector<int>(fingers, -1), std::vector<double>(fingers, NAN)});
        units.back().bin[cells[c].finger] = BinOf(ends, cells[c].value);
        units.back().residual_s[cells[c].finger] = cells[c].before_s - mean[cells[c].finger];
      }
      blocks.emplace_back(first_unit, static_cast<int>(units.size()));
    }
    begin = end;
  }
  if (!inside) {
    blocks.emplace_back(0, static_cast<int>(units.size()));
    // A finger's own bias is no dependence.
    for (int i = 0; i < fingers; ++i) {
      double sum = 0, count = 0;
      for (const Unit& unit : units)
        if (!std::isnan(unit.residual_s[i])) sum += unit.residual_s[i], count += 1;
      for (Unit& unit : units) unit.residual_s[i] -= sum / count;
    }
  }

  std::vector<int> source(units.size());
  for (size_t u = 0; u < units.size(); ++u) source[u] = static_cast<int>(u);
  std::vector<double> sums;
  const double observed = Dependence(units, source, fingers, bins, &sums);
  RandomStream random(seed_, RandomDomain::kDiagnosis, number, 3);
  std::vector<double> permuted(kPermutations);
  for (double& value : permuted) {
    for (const auto& [begin, end] : blocks)
      for (int u = end - 1; u > begin; --u) std::swap(source[u], source[begin + random.Below(u - begin + 1)]);
    value = Dependence(units, source, fingers, bins, &sums);
  }
  return PermutationP(observed, permuted);
}

}  // namespace

void DescribeCurves(const Observations& observations, const Prediction& initial,
                    const std::vector<double>& before, const std::vector<double>& after, uint64_t seed,
                    v1::Report* report) {
  const CurveMaker maker(observations, before, after, seed);
  const auto covariates = ListResidualCovariates(observations, initial);
  int curves = 0;
  for (const ResidualCovariate& covariate : covariates) curves += covariate.name != "finger";
  int number = 0;
  for (const ResidualCovariate& covariate : covariates)
    if (covariate.name != "finger") maker.Make(covariate, number++, curves, report->add_curves());
}

}  // namespace touchstone
