#include "server/diagnosis/residuals/photographs/photograph_slices.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/numbers/random.h"
#include "server/diagnosis/residuals/photographs/photograph_covariates.h"
#include "server/diagnosis/residuals/photographs/rules.h"
#include "server/diagnosis/residuals/rules.h"
#include "server/diagnosis/residuals/slices/slice_search.h"

namespace touchstone::diagnosis::residuals {
namespace {

struct PixelHalf {
  std::vector<int> live;
  double excess = 0;
};

// Sampled pixels, spread evenly over every picture.
class PhotographSliceFinder {
 public:
  PhotographSliceFinder(const images::Photographs& photographs, const std::vector<image::Photo>& expected,
                        const std::vector<ResidualCovariate>& covariates, double sigma_grey)
      : photographs_(photographs), expected_(expected), covariates_(covariates), sigma_grey_(sigma_grey) {}

  std::vector<images::PhotographSlice> Find() {
    Collect();
    const double noise =
        sigma_grey_ * sigma_grey_ * photographs_.width() * photographs_.height() * photographs_.size();
    if (!(search_.excess > 0) || !(total_excess_ > kPhotographResidualRules.certain_share * noise)) return {};
    const int min_cells = std::max(20, static_cast<int>(0.005 * cells_.size()));
    std::vector<images::PhotographSlice> slices;
    while (slices.size() < kPhotographResidualRules.max_slices) {
      const std::vector<SliceCandidate> candidates =
          SearchSlices(bins_, cells_, search_.live, min_cells, kResidualRules.slice_tries);
      const auto good =
          std::find_if(candidates.begin(), candidates.end(), [&](const SliceCandidate& candidate) {
            return candidate.score < kResidualRules.min_slice_share * search_.excess ||
                   AgreesOnOtherHalf(candidate);
          });
      if (good == candidates.end() || good->score < kResidualRules.min_slice_share * search_.excess) break;
      std::vector<int> live = search_.live;
      live.insert(live.end(), check_.live.begin(), check_.live.end());
      const SliceCandidate chosen = Simplified(bins_, cells_, live, *good);
      slices.push_back(Told(chosen));
      for (PixelHalf* half : {&search_, &check_})
        half->live.erase(std::remove_if(half->live.begin(), half->live.end(),
                                        [&](int cell) { return HoldsCell(chosen, cell); }),
                         half->live.end());
    }
    std::stable_sort(slices.begin(), slices.end(), [](const auto& a, const auto& b) {
      return a.share_of_excess_error > b.share_of_excess_error;
    });
    return slices;
  }

 private:
  void Collect() {
    const int pixels = photographs_.width() * photographs_.height();
    const int each = std::clamp(kPhotographResidualRules.max_pixels / std::max(1, photographs_.size()),
                                kPhotographResidualRules.min_pixels_of_picture.value(), pixels);
    std::vector<int> picture, place;
    for (int k = 0; k < photographs_.size(); ++k) {
      const std::vector<float> residual = PixelResiduals(photographs_, expected_, k);
      for (const float r : residual) total_excess_ += static_cast<double>(r) * r - sigma_grey_ * sigma_grey_;
      const auto words = RandomBlock(0, RandomDomain::kDiagnosis, photographs_.pose[k], 2, 0);
      PixelHalf& half = words[0] >> 63 ? search_ : check_;
      const uint64_t first = RandomBlock(0, RandomDomain::kDiagnosis, k, 3, 0)[0];
      for (int j = 0; j < each; ++j) {
        // A golden-ratio walk: as even as a grid, without its rows.
        const double turn = std::fmod(UniformFromWord(first) + j * 0.6180339887498949, 1.0);
        const int at = std::min(pixels - 1, static_cast<int>(turn * pixels));
        const double excess = static_cast<double>(residual[at]) * residual[at] - sigma_grey_ * sigma_grey_;
        half.live.push_back(static_cast<int>(cells_.size()));
        half.excess += excess;
        cells_.residual_s.push_back(residual[at]);
        cells_.excess_s2.push_back(excess);
        pose_.push_back(photographs_.pose[k]);
        picture.push_back(k), place.push_back(at);
      }
    }
    for (const ResidualCovariate& covariate : covariates_) {
      std::vector<double> values(cells_.size());
      for (size_t cell = 0; cell < cells_.size(); ++cell)
        values[cell] = covariate.value(picture[cell], place[cell]);
      bins_.emplace_back(&covariate, values);
      std::vector<uint8_t> bin(cells_.size());
      for (size_t cell = 0; cell < cells_.size(); ++cell) bin[cell] = bins_.back().Bin(values[cell]);
      cells_.bin.push_back(std::move(bin));
    }
  }

  bool HoldsCell(const SliceCandidate& slice, int cell) const {
    return std::all_of(slice.conditions.begin(), slice.conditions.end(),
                       [&](const SliceCondition& condition) {
                         return condition.Holds(cells_.bin[condition.covariate][cell]);
                       });
  }

  bool AgreesOnOtherHalf(const SliceCandidate& slice) const {
    double excess = 0;
    for (const int cell : check_.live) excess += cells_.excess_s2[cell];
    const double per_cell = excess / std::max<size_t>(1, check_.live.size());
    std::map<int, double> lifts;
    for (const int cell : check_.live)
      if (HoldsCell(slice, cell)) lifts[pose_[cell]] += cells_.excess_s2[cell] - per_cell;
    if (lifts.size() < kPhotographResidualRules.min_slice_poses) return false;
    double sum = 0, squares = 0;
    for (const auto& [pose, lift] : lifts) sum += lift, squares += lift * lift;
    return squares > 0 && sum > kResidualRules.certain_slice_z * std::sqrt(squares);
  }

  images::PhotographSlice Told(const SliceCandidate& slice) const {
    const int pixels = photographs_.width() * photographs_.height();
    images::PhotographSlice told;
    double count = 0, sum = 0, squares = 0;
    for (int k = 0; k < photographs_.size(); ++k) {
      const std::vector<float> residual = PixelResiduals(photographs_, expected_, k);
      bool any = false;
      for (int at = 0; at < pixels; ++at) {
        const bool holds = std::all_of(slice.conditions.begin(), slice.conditions.end(), [&](const auto& c) {
          return c.Holds(bins_[c.covariate].Bin(covariates_[c.covariate].value(k, at)));
        });
        if (!holds) continue;
        any = true;
        ++count, sum += residual[at], squares += static_cast<double>(residual[at]) * residual[at];
      }
      told.images += any;
    }
    std::vector<std::string> conditions;
    for (const SliceCondition& condition : slice.conditions)
      conditions.push_back(bins_[condition.covariate].Words(condition.low, condition.high));
    told.slice = absl::StrJoin(conditions, " and ");
    const double excess = squares - count * sigma_grey_ * sigma_grey_;
    told.mean_residual_grey = sum / count;
    told.rmse_grey = std::sqrt(squares / count);
    told.share_of_excess_error = std::clamp(excess / total_excess_, 0.0, 1.0);
    if (count * told.mean_residual_grey * told.mean_residual_grey >= kResidualRules.one_sided_share * excess)
      told.words = absl::StrFormat("%s than expected by %.3g grey levels",
                                   told.mean_residual_grey > 0 ? "brighter" : "darker",
                                   std::abs(told.mean_residual_grey));
    else
      told.words = absl::StrFormat("off by %.3g grey levels, brighter here and darker there",
                                   std::sqrt(std::max(0.0, excess) / count));
    return told;
  }

  const images::Photographs& photographs_;
  const std::vector<image::Photo>& expected_;
  const std::vector<ResidualCovariate>& covariates_;
  const double sigma_grey_;
  std::vector<SliceBins> bins_;
  SliceCells cells_;  // in grey levels, where names say seconds
  std::vector<int> pose_;
  PixelHalf search_, check_;
  double total_excess_ = 0;
};

}  // namespace

std::vector<images::PhotographSlice> FindPhotographSlices(const images::Photographs& photographs,
                                                          const std::vector<image::Photo>& expected,
                                                          const std::vector<ResidualCovariate>& covariates,
                                                          double sigma_grey) {
  return PhotographSliceFinder(photographs, expected, covariates, sigma_grey).Find();
}

}  // namespace touchstone::diagnosis::residuals
