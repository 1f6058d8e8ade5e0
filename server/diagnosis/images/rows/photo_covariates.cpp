#include "server/diagnosis/images/rows/photo_covariates.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/units.h"
#include "server/diagnosis/images/rows/rules.h"
#include "server/diagnosis/images/rules.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr const char* kNames[] = {"radius",        "row",      "column",        "grey",
                                  "incidence_deg", "depth_mm", "session_time_s"};
constexpr int kNamed = 7;

double ValueOf(int covariate, const Photographs& p, const image::Photo& photo, int k, int x, int y) {
  const size_t at = static_cast<size_t>(y) * p.width() + x;
  const session::CameraIntrinsics& lens = p.set->camera;
  switch (covariate) {
    case 0:
      return std::hypot(x + 0.5 - lens.cx_px, y + 0.5 - lens.cy_px) /
             (0.5 * std::hypot(lens.width_px, lens.height_px));
    case 1:
      return y + 0.5;
    case 2:
      return x + 0.5;
    case 3:
      return photo.grey[at];
    case 4:
      return photo.mask[at] ? photo.incidence_rad[at] * 180 / M_PI : NAN;
    case 5:
      return photo.mask[at] ? photo.depth_m[at] * kMillimetresPerMetre : NAN;
    default:
      return p.TimeOf(k);
  }
}

struct BinSums {
  std::vector<std::vector<double>> sum, count;  // [pose][bin]
};

PhotoCovariate Judge(const std::string& name, const BinSums& bins, double low, double high, double squares) {
  PhotoCovariate result;
  result.name = name;
  const int poses = static_cast<int>(bins.sum.size());
  double total = 0;
  for (const auto& counts : bins.count)
    for (const double count : counts) total += count;
  double explained = 0, smallest = 1, taken = 0;
  for (int b = 0; b < kPhotoRowRules.curve_bins; ++b) {
    double sum = 0, count = 0;
    int with = 0;
    for (int pose = 0; pose < poses; ++pose)
      sum += bins.sum[pose][b], count += bins.count[pose][b], with += bins.count[pose][b] > 0;
    if (count < kPhotoRowRules.min_bin_share * total || with < 3) continue;
    const double mean = sum / count;
    double scatter = 0;
    for (int pose = 0; pose < poses; ++pose)
      scatter += std::pow(bins.sum[pose][b] - mean * bins.count[pose][b], 2);
    const double error = std::sqrt(scatter * with / (with - 1.0)) / count;
    result.knots.push_back(low + (b + 0.5) * (high - low) / kPhotoRowRules.curve_bins);
    result.mean_grey.push_back(mean);
    if (error > 0) {
      const double t = std::abs(mean) / error;
      smallest = std::min(smallest, 2 * StudentTail(t, with - 1));
      explained += 0.5 * t * t;
    }
    // What the mean of the other folds takes from each fold.
    for (int fold = 0; fold < kImageRules.folds; ++fold) {
      double own_sum = 0, own_count = 0;
      for (int pose = fold; pose < poses; pose += kImageRules.folds)
        own_sum += bins.sum[pose][b], own_count += bins.count[pose][b];
      if (count - own_count <= 0) continue;
      const double other = (sum - own_sum) / (count - own_count);
      taken += 2 * other * own_sum - other * other * own_count;
    }
  }
  result.gain_nats = explained;
  result.p = std::min(1.0, smallest * kPhotoRowRules.curve_bins * kNamed);
  result.unseen_gain = squares > 0 ? taken / squares : 0;
  return result;
}

}  // namespace

std::vector<PhotoCovariate> TestCovariates(const Photographs& p, const std::vector<image::Photo>& expected) {
  std::vector<PhotoCovariate> tests;
  double squares = 0;
  for (int k = 0; k < p.size(); ++k)
    for (size_t i = 0; i < expected[k].grey.size(); ++i)
      squares += std::pow(p.measured_grey[k][i] - expected[k].grey[i], 2);
  for (int covariate = 0; covariate < kNamed; ++covariate) {
    if (covariate == kNamed - 1 && !p.set->has_session_time) continue;
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < p.size(); ++k)
      for (int y = 0; y < p.height(); ++y)
        for (int x = 0; x < p.width(); ++x) {
          const double value = ValueOf(covariate, p, expected[k], k, x, y);
          if (std::isnan(value)) continue;
          low = std::min(low, value), high = std::max(high, value);
        }
    if (!(high > low)) continue;
    BinSums bins;
    bins.sum.assign(p.poses, std::vector<double>(kPhotoRowRules.curve_bins.value(), 0.0));
    bins.count = bins.sum;
    for (int k = 0; k < p.size(); ++k)
      for (int y = 0; y < p.height(); ++y)
        for (int x = 0; x < p.width(); ++x) {
          const double value = ValueOf(covariate, p, expected[k], k, x, y);
          if (std::isnan(value)) continue;
          const int b = std::clamp(static_cast<int>((value - low) / (high - low) * kPhotoRowRules.curve_bins),
                                   0, kPhotoRowRules.curve_bins - 1);
          const size_t at = static_cast<size_t>(y) * p.width() + x;
          if (p.record->Clipped(expected[k].grey[at]) > kPhotoRowRules.max_clipped_share) continue;
          bins.sum[p.pose[k]][b] += static_cast<double>(p.measured_grey[k][at]) - expected[k].grey[at];
          bins.count[p.pose[k]][b] += 1;
        }
    tests.push_back(Judge(kNames[covariate], bins, low, high, squares));
  }
  std::stable_sort(tests.begin(), tests.end(), [](const PhotoCovariate& a, const PhotoCovariate& b) {
    return a.unseen_gain > b.unseen_gain;
  });
  return tests;
}

}  // namespace touchstone::diagnosis::images
