#include "server/diagnosis/residuals/photographs/photograph_curves.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/numbers/random.h"
#include "server/diagnosis/residuals/distribution/permutation.h"
#include "server/diagnosis/residuals/photographs/photograph_covariates.h"
#include "server/diagnosis/residuals/photographs/rules.h"
#include "server/diagnosis/residuals/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// Sums of one picture in each bin.
struct PictureBins {
  std::vector<double> count, value, before, after;
};

// Upper ends of bins that hold about equally many pixels.
std::vector<double> EndsOfBins(const images::Photographs& photographs, const ResidualCovariate& covariate) {
  std::vector<double> values;
  const int pixels = photographs.width() * photographs.height();
  const int each = std::max(
      1, std::min(kPhotographResidualRules.sampled_pixels.value(), 400000 / std::max(1, photographs.size())));
  for (int k = 0; k < photographs.size(); ++k)
    for (int j = 0; j < each; ++j) {
      const double value = covariate.value(k, static_cast<int>(static_cast<int64_t>(j) * pixels / each));
      if (!std::isnan(value)) values.push_back(value);
    }
  std::sort(values.begin(), values.end());
  std::vector<double> ends;
  for (int b = 1; b <= kResidualRules.curve_bins && !values.empty(); ++b) {
    const double end = values[std::min(values.size() - 1, values.size() * b / kResidualRules.curve_bins)];
    if (ends.empty() || end > ends.back()) ends.push_back(end);
  }
  if (!ends.empty()) ends.back() = INFINITY;  // what the sample missed
  return ends;
}

// Sum over bins of (sum of residuals)^2 / count: what the curve explains.
double Explained(const std::vector<double>& sums, const std::vector<double>& counts) {
  double explained = 0;
  for (size_t b = 0; b < sums.size(); ++b)
    if (counts[b] > 0) explained += sums[b] * sums[b] / counts[b];
  return explained;
}

// The pictures of one pose, which share whatever the model gets wrong there, count as one.
struct PoseBins {
  std::vector<std::vector<double>> sums;  // [pose][bin]
  std::vector<double> counts;             // [bin]
};

// Of any dependence on what varies within pictures: the pattern of each pose might as well have the other sign.
double SignP(const PoseBins& poses, uint64_t seed, uint64_t number) {
  if (poses.sums.size() < kPhotographResidualRules.min_independent) return 1;
  std::vector<double> all(poses.counts.size(), 0);
  const auto total = [&](RandomStream* random) {
    std::fill(all.begin(), all.end(), 0);
    for (const std::vector<double>& pose : poses.sums) {
      const double sign = random != nullptr && random->Word() >> 63 ? -1 : 1;
      for (size_t b = 0; b < all.size(); ++b) all[b] += sign * pose[b];
    }
    return Explained(all, poses.counts);
  };
  const double observed = total(nullptr);
  std::vector<double> permuted;
  RandomStream random(seed, RandomDomain::kDiagnosis, 70000 + number);
  for (int p = 0; p < kResidualRules.permutations; ++p) permuted.push_back(total(&random));
  return PermutationP(observed, permuted);
}

// Of any dependence on the place in the session: the pictures of one pose might as well stand in another order.
double OrderP(const std::vector<double>& mean, const std::vector<int>& bin, const std::vector<int>& pose,
              int bins, uint64_t seed, uint64_t number) {
  // Poses of one picture have no order of their own; then pictures are exchanged at will.
  const int poses = pose.empty() ? 0 : 1 + *std::max_element(pose.begin(), pose.end());
  const bool within = static_cast<int>(mean.size()) >= 2 * poses;
  std::vector<int> group(mean.size(), 0);
  if (within) group = pose;
  std::vector<double> centred = mean;
  for (int g = 0; g <= (within ? poses : 0); ++g) {
    double sum = 0, count = 0;
    for (size_t k = 0; k < mean.size(); ++k)
      if (group[k] == g) sum += mean[k], ++count;
    for (size_t k = 0; k < mean.size(); ++k)
      if (group[k] == g) centred[k] -= sum / count;
  }
  std::vector<double> counts(bins, 0);
  for (const int b : bin) ++counts[b];
  const auto statistic = [&](const std::vector<double>& values) {
    std::vector<double> sums(bins, 0);
    for (size_t k = 0; k < values.size(); ++k) sums[bin[k]] += values[k];
    return Explained(sums, counts);
  };
  if (mean.size() < kPhotographResidualRules.min_independent) return 1;
  const double observed = statistic(centred);
  std::vector<double> permuted;
  RandomStream random(seed, RandomDomain::kDiagnosis, 80000 + number);
  std::vector<std::vector<int>> members(within ? poses : 1);
  for (size_t k = 0; k < mean.size(); ++k) members[group[k]].push_back(static_cast<int>(k));
  for (int p = 0; p < kResidualRules.permutations; ++p) {
    std::vector<double> shuffled = centred;
    for (const std::vector<int>& all : members)
      for (size_t k = all.size(); k > 1; --k) std::swap(shuffled[all[k - 1]], shuffled[all[random.Below(k)]]);
    permuted.push_back(statistic(shuffled));
  }
  return PermutationP(observed, permuted);
}

std::vector<PictureBins> Binned(const images::Photographs& photographs,
                                const std::vector<image::Photo>& before,
                                const std::vector<image::Photo>& after, const ResidualCovariate& covariate,
                                const std::vector<double>& ends, ThreadPool* pool) {
  std::vector<PictureBins> pictures(photographs.size());
  const int pixels = photographs.width() * photographs.height();
  ParallelFor(pool, photographs.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      PictureBins& bins = pictures[k];
      for (auto* column : {&bins.count, &bins.value, &bins.before, &bins.after})
        column->assign(ends.size(), 0);
      for (int at = 0; at < pixels; ++at) {
        const double value = covariate.value(k, at);
        if (std::isnan(value)) continue;
        const size_t b = std::lower_bound(ends.begin(), ends.end(), value) - ends.begin();
        const double measured = photographs.measured_grey[k][at];
        ++bins.count[b], bins.value[b] += value;
        bins.before[b] += measured - before[k].grey[at];
        bins.after[b] += measured - (after.empty() ? before : after)[k].grey[at];
      }
    }
  });
  return pictures;
}

class CurveOfPictures {
 public:
  CurveOfPictures(const images::Photographs& photographs, const std::vector<PictureBins>& pictures,
                  size_t bins)
      : photographs_(photographs), pictures_(pictures), bins_(bins) {}

  void FillBins(images::PhotographCurve* curve) const {
    for (size_t b = 0; b < bins_; ++b) {
      images::PhotographCurve::Bin bin;
      double count = 0;
      for (const PictureBins& picture : pictures_) {
        count += picture.count[b], bin.centre += picture.value[b];
        bin.mean_residual_grey += picture.before[b], bin.after_grey += picture.after[b];
      }
      if (count == 0) continue;
      bin.count = static_cast<int64_t>(count);
      bin.centre /= count, bin.mean_residual_grey /= count, bin.after_grey /= count;
      // Scatter of the poses' sums around the mean: neighbouring pixels share what is wrong.
      std::vector<double> apart(photographs_.poses, 0);
      for (size_t k = 0; k < pictures_.size(); ++k)
        apart[photographs_.pose[k]] +=
            pictures_[k].before[b] - pictures_[k].count[b] * bin.mean_residual_grey;
      const double scatter = std::inner_product(apart.begin(), apart.end(), apart.begin(), 0.0);
      const double poses = std::max(2, photographs_.poses);
      bin.std_error_grey = std::sqrt(scatter * poses / (poses - 1)) / count;
      curve->bins.push_back(bin);
    }
  }

  double P(bool is_time, bool is_after, uint64_t seed, uint64_t number) const {
    if (is_time) {
      std::vector<double> mean;
      std::vector<int> bin;
      for (const PictureBins& picture : pictures_) {
        const auto& sums = is_after ? picture.after : picture.before;
        const double count = std::accumulate(picture.count.begin(), picture.count.end(), 0.0);
        mean.push_back(std::accumulate(sums.begin(), sums.end(), 0.0) / std::max(1.0, count));
        bin.push_back(static_cast<int>(std::max_element(picture.count.begin(), picture.count.end()) -
                                       picture.count.begin()));
      }
      return OrderP(mean, bin, photographs_.pose, static_cast<int>(bins_), seed, number);
    }
    PoseBins poses;
    poses.sums.assign(photographs_.poses, std::vector<double>(bins_, 0));
    poses.counts.assign(bins_, 0);
    for (size_t k = 0; k < pictures_.size(); ++k)
      for (size_t b = 0; b < bins_; ++b) {
        poses.sums[photographs_.pose[k]][b] += (is_after ? pictures_[k].after : pictures_[k].before)[b];
        poses.counts[b] += pictures_[k].count[b];
      }
    return SignP(poses, seed, number);
  }

 private:
  const images::Photographs& photographs_;
  const std::vector<PictureBins>& pictures_;
  const size_t bins_;
};

}  // namespace

std::vector<images::PhotographCurve> PhotographCurves(const images::Photographs& photographs,
                                                      const std::vector<image::Photo>& before,
                                                      const std::vector<image::Photo>& after,
                                                      const std::vector<ResidualCovariate>& covariates,
                                                      uint64_t seed, ThreadPool* pool) {
  std::vector<images::PhotographCurve> curves;
  for (size_t c = 0; c < covariates.size(); ++c) {
    const ResidualCovariate& covariate = covariates[c];
    if (covariate.is_category()) continue;
    const std::vector<double> ends = EndsOfBins(photographs, covariate);
    if (ends.size() < 2) continue;
    const std::vector<PictureBins> pictures = Binned(photographs, before, after, covariate, ends, pool);
    const CurveOfPictures sums(photographs, pictures, ends.size());
    images::PhotographCurve curve;
    curve.covariate = covariate.name;
    curve.unit = covariate.unit;
    sums.FillBins(&curve);
    const bool is_time = covariate.name == "session_time_s";
    curve.p = sums.P(is_time, false, seed, 2 * c);
    curve.p_after = after.empty() ? curve.p : sums.P(is_time, true, seed, 2 * c + 1);
    curves.push_back(std::move(curve));
  }
  for (images::PhotographCurve& curve : curves)
    for (double* p : {&curve.p, &curve.p_after}) *p = std::min(1.0, *p * curves.size());
  return curves;
}

}  // namespace touchstone::diagnosis::residuals
