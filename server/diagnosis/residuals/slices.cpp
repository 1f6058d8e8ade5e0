#include "server/diagnosis/residuals/slices.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/diagnosis/residuals/slice_search.h"

namespace touchstone {
namespace {

constexpr int kMaxSlices = 6;
constexpr int kMaxTouchesSearched = 30000;
constexpr int kTries = 8;           // candidates that the other half is asked about, a slice
constexpr double kMinShare = 0.03;  // of the excess, for a slice to be worth a line
constexpr double kMinZ = 4;         // on the other half, for a slice to be believed
// ... and where the excess as a whole stands so many standard deviations above noise: something is there, and
// a slice of a few poses cannot reach four.
constexpr double kMinZOfMisfit = 1.8, kCertainMisfit = 10;
constexpr int kMinPoses = 5;            // a half
constexpr double kCoherentShare = 0.2;  // of a slice's excess in its mean, to call it early or late

struct Half {
  std::vector<int> live;  // cells that no slice holds yet
  double excess = 0;
};

// What the poses of one half say about a slice, as if nobody had looked before.
struct Verdict {
  double z_excess = 0, z_mean = 0;
};

class SliceFinder {
 public:
  SliceFinder(const Observations& observations, const Prediction& prediction,
              const std::vector<double>& residuals, double sigma_s)
      : observations_(observations),
        residuals_(residuals),
        sigma_s_(sigma_s),
        covariates_(ListResidualCovariates(observations, prediction)) {}

  std::vector<v1::Slice> Find();

 private:
  void Collect(const std::vector<int>& touches);
  Verdict Judge(const SliceCandidate& slice, const std::vector<int>& live) const;
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
  v1::Slice Describe(const SliceCandidate& slice, double all_excess_s2) const;
  double TotalExcess() const;

  const Observations& observations_;
  const std::vector<double>& residuals_;
  const double sigma_s_;
  const std::vector<ResidualCovariate> covariates_;
  std::vector<SliceBins> bins_;
  SliceCells cells_;
  std::vector<int> pose_;  // a cell
  Half search_, check_;
};

void SliceFinder::Collect(const std::vector<int>& touches) {
  std::vector<int> cell_touch, cell_finger;
  for (const int k : touches) {
    const double noise_s2 = NoiseShare(sigma_s_, FingersCompared(observations_, residuals_, k));
    // Half of the poses, drawn by number, so that no order of the session can split them badly.
    const bool search = RandomBlock(0, RandomDomain::kDiagnosis, observations_.pose[k], 2, 0)[0] >> 63;
    Half& half = search ? search_ : check_;
    for (int i = 0; i < observations_.fingers; ++i) {
      const double residual_s = residuals_[size_t(k) * observations_.fingers + i];
      if (std::isnan(residual_s)) continue;
      half.live.push_back(static_cast<int>(cells_.size()));
      half.excess += residual_s * residual_s - noise_s2;
      cells_.residual_s.push_back(residual_s);
      cells_.excess_s2.push_back(residual_s * residual_s - noise_s2);
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

Verdict SliceFinder::Judge(const SliceCandidate& slice, const std::vector<int>& live) const {
  double excess = 0, residual = 0;
  for (const int cell : live) excess += cells_.excess_s2[cell], residual += cells_.residual_s[cell];
  const double excess_a_cell = excess / std::max<size_t>(1, live.size());
  const double residual_a_cell = residual / std::max<size_t>(1, live.size());
  // Cells of one pose stand together in `live` only by chance: sums a pose first, then over poses.
  std::map<int, std::pair<double, double>> sums;
  for (const int cell : live) {
    if (!Holds(slice, cell)) continue;
    auto& [lift, mean] = sums[pose_[cell]];
    lift += cells_.excess_s2[cell] - excess_a_cell;
    mean += cells_.residual_s[cell] - residual_a_cell;
  }
  Verdict verdict;
  if (sums.size() < kMinPoses) return verdict;
  double lift = 0, lift2 = 0, mean = 0, mean2 = 0;
  for (const auto& [pose, sum] : sums) {
    lift += sum.first, lift2 += sum.first * sum.first;
    mean += sum.second, mean2 += sum.second * sum.second;
  }
  if (lift2 > 0) verdict.z_excess = lift / std::sqrt(lift2);
  if (mean2 > 0) verdict.z_mean = mean / std::sqrt(mean2);
  return verdict;
}

double SliceFinder::TotalExcess() const {
  double excess = 0;
  for (int k = 0; k < observations_.size(); ++k) {
    const int compared = FingersCompared(observations_, residuals_, k);
    if (!observations_.used[k] || compared < 2) continue;
    for (int i = 0; i < observations_.fingers; ++i) {
      const double residual_s = residuals_[size_t(k) * observations_.fingers + i];
      if (!std::isnan(residual_s)) excess += residual_s * residual_s - NoiseShare(sigma_s_, compared);
    }
  }
  return excess;
}

v1::Slice SliceFinder::Describe(const SliceCandidate& slice, double all_excess_s2) const {
  double touches = 0, cells = 0, sum = 0, squares = 0, excess = 0;
  for (int k = 0; k < observations_.size(); ++k) {
    const int compared = FingersCompared(observations_, residuals_, k);
    if (!observations_.used[k] || compared < 2) continue;
    bool any = false;
    for (int i = 0; i < observations_.fingers; ++i) {
      const double residual_s = residuals_[size_t(k) * observations_.fingers + i];
      if (std::isnan(residual_s) || !HoldsAt(slice, k, i)) continue;
      any = true;
      ++cells;
      sum += residual_s;
      squares += residual_s * residual_s;
      excess += residual_s * residual_s - NoiseShare(sigma_s_, compared);
    }
    touches += any;
  }
  std::vector<std::string> words;
  for (const SliceCondition& condition : slice.conditions)
    words.push_back(bins_[condition.covariate].Words(condition.low, condition.high));
  v1::Slice message;
  message.set_slice(absl::StrJoin(words, " and "));
  message.set_touches(static_cast<uint32_t>(touches));
  // Of whole touches the mean is zero but for rounding.
  const double mean_s = std::abs(sum / cells) < 1e-9 ? 0 : sum / cells;
  message.set_mean_residual_us(mean_s * 1e6);
  message.set_rmse_us(std::sqrt(squares / cells) * 1e6);
  message.set_share_of_excess_error(std::clamp(excess / all_excess_s2, 0.0, 1.0));
  if (cells * mean_s * mean_s >= kCoherentShare * excess)
    message.set_words(
        absl::StrCat("contact too ", mean_s < 0 ? "early" : "late", " by ", TimeInWords(std::abs(mean_s))));
  else
    message.set_words(absl::StrCat("off by ", TimeInWords(std::sqrt(std::max(0.0, excess) / cells)),
                                   ", early here and late there"));
  return message;
}

std::vector<v1::Slice> SliceFinder::Find() {
  const std::vector<int> touches = ThinnedTouches(observations_, residuals_, kMaxTouchesSearched);
  Collect(touches);
  const double total = TotalExcess();
  if (!(total > 0) || !(search_.excess > 0)) return {};
  double squares = 0;  // variance of the excess that noise alone would have, over 2 sigma^4
  for (int k = 0; k < observations_.size(); ++k)
    if (observations_.used[k]) squares += std::max(0, FingersCompared(observations_, residuals_, k) - 1);
  const bool certain = total > kCertainMisfit * sigma_s_ * sigma_s_ * std::sqrt(2 * squares);
  const double min_z = certain ? kMinZOfMisfit : kMinZ;

  // A part must be large enough to picture; in a small set a fifth of it is.
  const double min_touches =
      std::min(std::max(50.0, 0.02 * touches.size()), std::max(4.0, 0.2 * touches.size()));
  const int min_cells = static_cast<int>(std::ceil(0.5 * min_touches));

  std::vector<v1::Slice> slices;
  while (static_cast<int>(slices.size()) < kMaxSlices) {
    const auto candidates = SearchSlices(bins_, cells_, search_.live, min_cells, kTries);
    std::vector<int> live = search_.live;
    live.insert(live.end(), check_.live.begin(), check_.live.end());
    bool found = false;
    SliceCandidate chosen;
    for (const SliceCandidate& candidate : candidates) {
      if (candidate.score < kMinShare * search_.excess) break;
      const Verdict there = Judge(candidate, search_.live), here = Judge(candidate, check_.live);
      const bool same_bias = there.z_mean * here.z_mean > 0 && std::abs(here.z_mean) > min_z;
      found = here.z_excess > min_z || same_bias;
      if (found) {
        chosen = Simplified(bins_, cells_, live, candidate);
        break;
      }
    }
    if (!found) break;
    slices.push_back(Describe(chosen, total));
    for (Half* half : {&search_, &check_})
      half->live.erase(
          std::remove_if(half->live.begin(), half->live.end(), [&](int cell) { return Holds(chosen, cell); }),
          half->live.end());
  }
  std::stable_sort(slices.begin(), slices.end(), [](const v1::Slice& a, const v1::Slice& b) {
    return a.share_of_excess_error() > b.share_of_excess_error();
  });
  return slices;
}

}  // namespace

std::string TimeInWords(double time_s) {
  const double size_s = std::abs(time_s);
  const auto figures = [](double value) {
    return value >= 100  ? absl::StrFormat("%.0f", value)
           : value >= 10 ? absl::StrFormat("%.1f", value)
                         : absl::StrFormat("%.2g", value);
  };
  if (size_s >= 1) return absl::StrCat(absl::StrFormat("%.3g", time_s), " s");
  if (size_s >= 0.9995e-3) return absl::StrCat(time_s < 0 ? "-" : "", figures(size_s * 1e3), " ms");
  return absl::StrCat(time_s < 0 ? "-" : "", figures(size_s * 1e6), " us");
}

std::vector<v1::Slice> FindSlices(const Observations& observations, const Prediction& prediction,
                                  const std::vector<double>& residuals, double sigma_s) {
  return SliceFinder(observations, prediction, residuals, sigma_s).Find();
}

}  // namespace touchstone
