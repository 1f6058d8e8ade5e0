#include "server/diagnosis/residuals/slices/slices.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/text/readable_time.h"
#include "server/diagnosis/residuals/rules.h"
#include "server/diagnosis/residuals/slices/rules.h"
#include "server/diagnosis/residuals/slices/slice_search.h"

namespace touchstone::diagnosis::residuals {
namespace {

// One half of the poses. A cell is one observed finger of one touch.
struct Half {
  std::vector<int> live;  // cells that no slice holds yet
  double excess_s2 = 0;
};

// Evidence of one half for a slice: z scores of its excess error and of its mean residual against the half's,
// with poses as the independent units.
struct SliceEvidence {
  double z_excess = 0, z_mean = 0;
};

class SliceFinder {
 public:
  // `less`: residuals whose squares are no excess; null: noise of sigma_s has that part.
  SliceFinder(const touches::Observations& observations, const touches::Prediction& prediction,
              const std::vector<double>& residuals, double sigma_s, const std::vector<double>* less)
      : observations_(observations),
        residuals_(residuals),
        sigma_s_(sigma_s),
        less_(less),
        covariates_(ListResidualCovariates(observations, prediction)) {}

  std::vector<ErrorSlice> Find();

 private:
  void Collect(const std::vector<int>& touches);
  SliceEvidence EvidenceOf(const SliceCandidate& slice, const std::vector<int>& live) const;
  bool Confirmed(const SliceCandidate& slice, double min_z) const;
  bool Holds(const SliceCandidate& slice, int cell) const {
    for (const SliceCondition& condition : slice.conditions)
      if (!condition.Holds(cells_.bin[condition.covariate][cell])) return false;
    return true;
  }
  bool HoldsAt(const SliceCandidate& slice, int k, int finger) const {
    for (const SliceCondition& c : slice.conditions)
      if (!c.Holds(bins_[c.covariate].Bin(covariates_[c.covariate].value(k, finger)))) return false;
    return true;
  }
  ErrorSlice Describe(const SliceCandidate& slice, double all_excess_s2) const;
  double TotalExcess() const;                 // s^2
  double MinZ(double total_excess_s2) const;  // that a slice must reach on the other half

  const touches::Observations& observations_;
  const std::vector<double>& residuals_;
  // The excess of one finger's residual over what is no error of the model, s^2. `compared`: fingers of the touch.
  double Excess(int k, int finger, int compared) const {
    const size_t at = static_cast<size_t>(k) * observations_.fingers + finger;
    const double no_error_s2 =
        less_ == nullptr ? NoiseShare(sigma_s_, compared) : (*less_)[at] * (*less_)[at];
    return residuals_[at] * residuals_[at] - no_error_s2;
  }

  const double sigma_s_;
  const std::vector<double>* less_;
  const std::vector<ResidualCovariate> covariates_;
  std::vector<SliceBins> bins_;
  SliceCells cells_;
  std::vector<int> pose_;  // of each cell
  Half search_, check_;
};

void SliceFinder::Collect(const std::vector<int>& touches) {
  std::vector<int> cell_touch, cell_finger;
  for (const int k : touches) {
    const int compared = FingersCompared(observations_, residuals_, k);
    // The halves are drawn by the number of the pose, so that no order of the session can split them badly.
    const bool search = RandomBlock(0, RandomDomain::kDiagnosis, observations_.pose[k], 2, 0)[0] >> 63;
    Half& half = search ? search_ : check_;
    for (int i = 0; i < observations_.fingers; ++i) {
      const double residual_s = residuals_[size_t(k) * observations_.fingers + i];
      if (std::isnan(residual_s)) continue;
      half.live.push_back(static_cast<int>(cells_.size()));
      half.excess_s2 += Excess(k, i, compared);
      cells_.residual_s.push_back(residual_s);
      cells_.excess_s2.push_back(Excess(k, i, compared));
      pose_.push_back(observations_.pose[k]);
      cell_touch.push_back(k);
      cell_finger.push_back(i);
    }
  }
  for (const ResidualCovariate& covariate : covariates_) {
    std::vector<double> values(cells_.size());
    for (size_t cell = 0; cell < cells_.size(); ++cell)
      values[cell] = covariate.value(cell_touch[cell], cell_finger[cell]);
    bins_.emplace_back(&covariate, values);
    std::vector<uint8_t> bin(cells_.size());
    for (size_t cell = 0; cell < cells_.size(); ++cell) bin[cell] = bins_.back().Bin(values[cell]);
    cells_.bin.push_back(std::move(bin));
  }
}

SliceEvidence SliceFinder::EvidenceOf(const SliceCandidate& slice, const std::vector<int>& live) const {
  double excess = 0, residual = 0;
  for (const int cell : live) excess += cells_.excess_s2[cell], residual += cells_.residual_s[cell];
  const double excess_per_cell = excess / std::max<size_t>(1, live.size());
  const double residual_per_cell = residual / std::max<size_t>(1, live.size());
  // Repeats of a pose share its misfit, so sums are taken per pose first, then over poses.
  std::map<int, std::pair<double, double>> sums;
  for (const int cell : live) {
    if (!Holds(slice, cell)) continue;
    auto& [lift, mean] = sums[pose_[cell]];
    lift += cells_.excess_s2[cell] - excess_per_cell;
    mean += cells_.residual_s[cell] - residual_per_cell;
  }
  SliceEvidence evidence;
  if (sums.size() < kSliceRules.min_poses) return evidence;
  double lift = 0, lift2 = 0, mean = 0, mean2 = 0;
  for (const auto& [pose, sum] : sums) {
    lift += sum.first, lift2 += sum.first * sum.first;
    mean += sum.second, mean2 += sum.second * sum.second;
  }
  if (lift2 > 0) evidence.z_excess = lift / std::sqrt(lift2);
  if (mean2 > 0) evidence.z_mean = mean / std::sqrt(mean2);
  return evidence;
}

double SliceFinder::TotalExcess() const {
  double excess = 0;
  for (int k = 0; k < observations_.size(); ++k) {
    const int compared = FingersCompared(observations_, residuals_, k);
    if (!observations_.used[k] || compared < 2) continue;
    for (int i = 0; i < observations_.fingers; ++i) {
      const double residual_s = residuals_[size_t(k) * observations_.fingers + i];
      if (!std::isnan(residual_s)) excess += Excess(k, i, compared);
    }
  }
  return excess;
}

ErrorSlice SliceFinder::Describe(const SliceCandidate& slice, double all_excess_s2) const {
  ErrorSlice described;
  described.cells.resize(residuals_.size());
  int touches = 0;
  double cells = 0, sum = 0, squares = 0, excess = 0;
  for (int k = 0; k < observations_.size(); ++k) {
    const int compared = FingersCompared(observations_, residuals_, k);
    if (!observations_.used[k] || compared < 2) continue;
    bool any = false;
    for (int i = 0; i < observations_.fingers; ++i) {
      const double residual_s = residuals_[size_t(k) * observations_.fingers + i];
      if (std::isnan(residual_s) || !HoldsAt(slice, k, i)) continue;
      any = true;
      described.cells[size_t(k) * observations_.fingers + i] = true;
      ++cells;
      sum += residual_s;
      squares += residual_s * residual_s;
      excess += Excess(k, i, compared);
    }
    touches += any;
  }
  std::vector<std::string> conditions;
  for (const SliceCondition& condition : slice.conditions)
    conditions.push_back(bins_[condition.covariate].Words(condition.low, condition.high));
  described.conditions = absl::StrJoin(conditions, " and ");
  described.touches = touches;
  // The mean over whole touches is zero except for rounding.
  const double mean_s = std::abs(sum / cells) < 1e-9 ? 0 : sum / cells;
  described.mean_residual_s = mean_s;
  described.rmse_s = std::sqrt(squares / cells);
  described.share_of_excess_error = std::clamp(excess / all_excess_s2, 0.0, 1.0);
  if (cells * mean_s * mean_s >= kResidualRules.one_sided_share * excess)
    described.words =
        absl::StrCat("contact too ", mean_s < 0 ? "early" : "late", " by ", TimeInWords(std::abs(mean_s)));
  else
    described.words = absl::StrCat("off by ", TimeInWords(std::sqrt(std::max(0.0, excess) / cells)),
                                   ", early here and late there");
  return described;
}

double SliceFinder::MinZ(double total_excess_s2) const {
  double squares = 0;  // variance of the excess that noise alone would have, over 2 sigma^4
  for (int k = 0; k < observations_.size(); ++k)
    if (observations_.used[k]) squares += std::max(0, FingersCompared(observations_, residuals_, k) - 1);
  const bool certain =
      total_excess_s2 > kSliceRules.certain_misfit * sigma_s_ * sigma_s_ * std::sqrt(2 * squares);
  return certain ? kResidualRules.certain_slice_z.value() : kSliceRules.min_z.value();
}

bool SliceFinder::Confirmed(const SliceCandidate& slice, double min_z) const {
  const SliceEvidence found = EvidenceOf(slice, search_.live), checked = EvidenceOf(slice, check_.live);
  const bool same_bias = found.z_mean * checked.z_mean > 0 && std::abs(checked.z_mean) > min_z;
  return checked.z_excess > min_z || same_bias;
}

std::vector<ErrorSlice> SliceFinder::Find() {
  const std::vector<int> touches = ThinnedTouches(observations_, residuals_, kSliceRules.max_touches);
  Collect(touches);
  const double total = TotalExcess();
  if (!(total > 0) || !(search_.excess_s2 > 0)) return {};
  const double min_z = MinZ(total);

  // A part must be large enough to picture; in a small set a fifth of it is.
  const double min_touches =
      std::min(std::max(50.0, 0.02 * touches.size()), std::max(4.0, 0.2 * touches.size()));
  const int min_cells = static_cast<int>(std::ceil(0.5 * min_touches));

  std::vector<ErrorSlice> slices;
  while (static_cast<int>(slices.size()) < kSliceRules.max_slices) {
    const auto candidates = SearchSlices(bins_, cells_, search_.live, min_cells, kResidualRules.slice_tries);
    const auto confirmed =
        std::find_if(candidates.begin(), candidates.end(), [&](const SliceCandidate& candidate) {
          return candidate.score < kResidualRules.min_slice_share * search_.excess_s2 ||
                 Confirmed(candidate, min_z);
        });
    // Candidates come best first: once one is too small, so are the rest.
    if (confirmed == candidates.end() ||
        confirmed->score < kResidualRules.min_slice_share * search_.excess_s2)
      break;
    std::vector<int> live = search_.live;
    live.insert(live.end(), check_.live.begin(), check_.live.end());
    const SliceCandidate chosen = Simplified(bins_, cells_, live, *confirmed);
    slices.push_back(Describe(chosen, total));
    for (Half* half : {&search_, &check_})
      half->live.erase(
          std::remove_if(half->live.begin(), half->live.end(), [&](int cell) { return Holds(chosen, cell); }),
          half->live.end());
  }
  std::stable_sort(slices.begin(), slices.end(), [](const ErrorSlice& a, const ErrorSlice& b) {
    return a.share_of_excess_error > b.share_of_excess_error;
  });
  return slices;
}

}  // namespace

std::vector<ErrorSlice> FindSlices(const touches::Observations& observations,
                                   const touches::Prediction& prediction,
                                   const std::vector<double>& residuals, double sigma_s) {
  return SliceFinder(observations, prediction, residuals, sigma_s, nullptr).Find();
}

std::vector<ErrorSlice> FindSlicesBeyond(const touches::Observations& observations,
                                         const touches::Prediction& prediction,
                                         const std::vector<double>& residuals,
                                         const std::vector<double>& other, double sigma_s) {
  return SliceFinder(observations, prediction, residuals, sigma_s, &other).Find();
}

}  // namespace touchstone::diagnosis::residuals
