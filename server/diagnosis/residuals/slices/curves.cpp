#include "server/diagnosis/residuals/slices/curves.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/residuals/distribution/dependence.h"
#include "server/diagnosis/residuals/rules.h"
#include "server/diagnosis/residuals/slices/covariates.h"
#include "server/diagnosis/residuals/slices/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

constexpr int kTestsPerCurve = 1000;  // numbers of random streams: apart by more than there are curves

// Upper ends of bins that hold equally many cells; categories have a bin each.
std::vector<double> BinEnds(const ResidualCovariate& covariate, std::vector<double> values) {
  std::vector<double> ends;
  if (covariate.is_category()) {
    for (size_t b = 0; b < covariate.labels.size(); ++b) ends.push_back(b + 0.5);
    return ends;
  }
  std::sort(values.begin(), values.end());
  for (int b = 1; b <= kResidualRules.curve_bins && !values.empty(); ++b) {
    const double end = values[std::min(values.size() - 1, values.size() * b / kResidualRules.curve_bins)];
    if (ends.empty() || end > ends.back()) ends.push_back(end);
  }
  return ends;
}

// Running sums of one finger's cells in one bin.
struct BinSums {
  double count = 0, value = 0, before = 0, after = 0, after_count = 0;
  // Scatter of the poses' sums around the bin's mean: repeats of a pose share whatever the model gets wrong
  // there, so the poses are what is independent.
  double scatter = 0, pose_sum = 0, pose_count = 0;
  int pose = -1, poses = 0;

  void ClosePose() {
    if (pose_count == 0) return;
    const double apart = pose_sum - pose_count * before / count;
    scatter += apart * apart;
    ++poses;
    pose_sum = pose_count = 0;
  }
};

// The bins of one finger's curve; cells of one pose stand side by side.
std::vector<ResidualCurveBin> BinsOfFinger(const std::vector<ResidualCell>& cells,
                                           const std::vector<double>& ends, int finger) {
  std::vector<BinSums> sums(ends.size());
  for (const ResidualCell& cell : cells) {
    if (cell.finger != finger) continue;
    BinSums& bin = sums[BinOf(ends, cell.covariate)];
    bin.count += 1;
    bin.value += cell.covariate;
    bin.before += cell.before_s;
    if (!std::isnan(cell.after_s)) bin.after += cell.after_s, bin.after_count += 1;
  }
  for (const ResidualCell& cell : cells) {
    if (cell.finger != finger) continue;
    BinSums& bin = sums[BinOf(ends, cell.covariate)];
    if (bin.pose != cell.pose) bin.ClosePose();
    bin.pose = cell.pose;
    bin.pose_sum += cell.before_s;
    bin.pose_count += 1;
  }
  std::vector<ResidualCurveBin> bins;
  for (BinSums& bin : sums) {
    bin.ClosePose();
    if (bin.count == 0) continue;
    ResidualCurveBin made;
    made.finger = finger;
    made.touches = static_cast<int>(bin.count);
    made.centre = bin.value / bin.count;
    made.mean_residual_s = bin.before / bin.count;
    made.improved_mean_residual_s = bin.after_count ? bin.after / bin.after_count : 0;
    if (bin.poses > 1) made.std_error_s = std::sqrt(bin.scatter * bin.poses / (bin.poses - 1)) / bin.count;
    bins.push_back(made);
  }
  return bins;
}

// NaN equals NaN.
bool Differ(const std::vector<double>& a, const std::vector<double>& b) {
  for (size_t n = 0; n < a.size(); ++n)
    if (a[n] != b[n] && !(std::isnan(a[n]) && std::isnan(b[n]))) return true;
  return false;
}

// The cells with what the improved model leaves in the place of what is tested.
std::vector<ResidualCell> ImprovedCells(const std::vector<ResidualCell>& cells) {
  std::vector<ResidualCell> improved;
  for (ResidualCell cell : cells) {
    if (std::isnan(cell.after_s)) continue;
    cell.before_s = cell.after_s;
    improved.push_back(cell);
  }
  return improved;
}

std::vector<ResidualCell> CellsOfFinger(const std::vector<ResidualCell>& cells, int finger) {
  std::vector<ResidualCell> own;
  for (const ResidualCell& cell : cells)
    if (cell.finger == finger) own.push_back(cell);
  return own;
}

// The covariates of curves: those of slices without the finger, and the touch's number, which slices do without
// beside the session time.
std::vector<ResidualCovariate> CurveCovariates(const touches::Observations& observations,
                                               const touches::Prediction& initial) {
  std::vector<ResidualCovariate> covariates = ListResidualCovariates(observations, initial);
  covariates.erase(std::remove_if(covariates.begin(), covariates.end(),
                                  [](const ResidualCovariate& c) { return c.name == "finger"; }),
                   covariates.end());
  if (observations.size() > 1)
    covariates.push_back({"touch_number", "touch number", "", {}, [&observations](int k, int) {
                            return double(observations.set->touch[observations.row[k]]);
                          }});
  return covariates;
}

}  // namespace

std::vector<ResidualCurve> MakeResidualCurves(const touches::Observations& observations,
                                              const touches::Prediction& initial,
                                              const std::vector<double>& before,
                                              const std::vector<double>& after, uint64_t seed) {
  const int fingers = observations.fingers;
  // Touches of one pose side by side, and so the cells that are made from them.
  std::vector<int> touches = ThinnedTouches(observations, before, kSliceRules.max_curve_touches);
  std::stable_sort(touches.begin(), touches.end(),
                   [&](int a, int b) { return observations.pose[a] < observations.pose[b]; });
  const std::vector<ResidualCovariate> covariates = CurveCovariates(observations, initial);
  const bool changed = Differ(before, after);
  std::vector<ResidualCurve> curves;
  for (const ResidualCovariate& covariate : covariates) {
    std::vector<ResidualCell> cells;
    std::vector<double> values;
    for (const int k : touches) {
      for (int i = 0; i < fingers; ++i) {
        const size_t at = size_t(k) * fingers + i;
        const double value = covariate.value(k, i);
        if (std::isnan(before[at]) || std::isnan(value)) continue;
        cells.push_back({k, observations.pose[k], i, value, before[at], after[at]});
        values.push_back(value);
      }
    }
    const std::vector<double> ends = BinEnds(covariate, std::move(values));
    ResidualCurve curve;
    curve.covariate = covariate.name;
    curve.unit = covariate.unit;
    if (ends.size() >= 2) {
      for (int i = 0; i < fingers; ++i) {
        const std::vector<ResidualCurveBin> bins = BinsOfFinger(cells, ends, i);
        curve.bins.insert(curve.bins.end(), bins.begin(), bins.end());
      }
      // Among many curves one bends by chance: Bonferroni.
      const double number_of_tests = static_cast<double>(covariates.size());
      int number = static_cast<int>(curves.size());
      const auto test = [&](const std::vector<ResidualCell>& tested, double tests) {
        const double p = DependenceP(tested, ends, fingers, seed, number);
        number += kTestsPerCurve;
        return std::min(1.0, tests * p);
      };
      const std::vector<ResidualCell> improved = changed ? ImprovedCells(cells) : std::vector<ResidualCell>();
      curve.p_value = test(cells, number_of_tests);
      curve.improved_p_value = changed ? test(improved, number_of_tests) : curve.p_value;
      const bool of_session = covariate.name == "session_time_s" || covariate.name == "touch_number";
      for (int i = 0; of_session && i < fingers; ++i) {
        FingerDependence own;
        own.finger = i;
        own.p_value = test(CellsOfFinger(cells, i), number_of_tests * fingers);
        own.improved_p_value =
            changed ? test(CellsOfFinger(improved, i), number_of_tests * fingers) : own.p_value;
        curve.fingers.push_back(own);
      }
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

}  // namespace touchstone::diagnosis::residuals
