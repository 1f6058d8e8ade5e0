#include "server/diagnosis/residuals/photographs/describe_photographs.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/residuals/photographs/photograph_covariates.h"
#include "server/diagnosis/residuals/photographs/photograph_curves.h"
#include "server/diagnosis/residuals/photographs/photograph_silhouette.h"
#include "server/diagnosis/residuals/photographs/photograph_slices.h"
#include "server/diagnosis/residuals/photographs/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

struct DescribedPicture {
  images::PhotographError error;
  Silhouette after;
};

DescribedPicture Describe(const images::Expectation& e, int k) {
  const images::Photographs& photographs = e.photographs;
  const session::PhotographRow& row = photographs.set->photographs[photographs.row[k]];
  DescribedPicture described;
  images::PhotographError& error = described.error;
  error.image = row.image;
  error.object = photographs.objects[photographs.object[k]];
  const std::vector<image::Photo>& after = e.after.empty() ? e.before : e.after;
  double sum = 0, squares = 0, squares_after = 0;
  const std::vector<float>& measured = photographs.measured_grey[k];
  for (size_t at = 0; at < measured.size(); ++at) {
    const double residual = measured[at] - e.before[k].grey[at], left = measured[at] - after[k].grey[at];
    sum += residual, squares += residual * residual, squares_after += left * left;
  }
  error.mean_residual_grey = sum / measured.size();
  error.rmse_grey = std::sqrt(squares / measured.size());
  error.rmse_after_grey = std::sqrt(squares_after / measured.size());
  const int width = photographs.width(), height = photographs.height();
  const Silhouette before = CompareSilhouettes(measured, e.before[k].grey, e.before[k].mask, width, height);
  error.silhouette_iou = before.iou;
  error.contour_distance_px = before.contour_distance_px;
  described.after =
      e.after.empty() ? before : CompareSilhouettes(measured, after[k].grey, after[k].mask, width, height);
  return described;
}

std::vector<uint8_t> Bytes(const std::vector<float>& grey) {
  std::vector<uint8_t> bytes(grey.size());
  for (size_t at = 0; at < grey.size(); ++at)
    bytes[at] = static_cast<uint8_t>(std::clamp(std::lround(grey[at]), 0L, 255L));
  return bytes;
}

images::PhotographMap MapOf(const images::Expectation& e, int k) {
  const images::Photographs& photographs = e.photographs;
  const std::vector<image::Photo>& after = e.after.empty() ? e.before : e.after;
  images::PhotographMap map;
  map.image = photographs.set->photographs[photographs.row[k]].image;
  map.object = photographs.objects[photographs.object[k]];
  map.width = photographs.width(), map.height = photographs.height();
  map.measured = Bytes(photographs.measured_grey[k]);
  map.before = Bytes(e.before[k].grey);
  map.after = Bytes(after[k].grey);
  map.residual_before_grey = PixelResiduals(photographs, e.before, k);
  map.residual_after_grey = PixelResiduals(photographs, after, k);
  return map;
}

// Means over the pictures where the silhouette can be told; contours as root mean squares.
void MeanSilhouettes(const std::vector<DescribedPicture>& pictures, images::PhotographDiagnosis* diagnosis) {
  double iou = 0, iou_after = 0, contour = 0, contour_after = 0, count = 0, outlines = 0;
  for (const DescribedPicture& picture : pictures) {
    if (std::isnan(picture.error.silhouette_iou) || std::isnan(picture.after.iou)) continue;
    iou += picture.error.silhouette_iou, iou_after += picture.after.iou, ++count;
    const double before = picture.error.contour_distance_px, after = picture.after.contour_distance_px;
    if (std::isnan(before) || std::isnan(after)) continue;
    contour += before * before, contour_after += after * after, ++outlines;
  }
  diagnosis->silhouette_iou = count > 0 ? iou / count : NAN;
  diagnosis->silhouette_iou_after = count > 0 ? iou_after / count : NAN;
  diagnosis->contour_distance_px = outlines > 0 ? std::sqrt(contour / outlines) : NAN;
  diagnosis->contour_distance_after_px = outlines > 0 ? std::sqrt(contour_after / outlines) : NAN;
}

// The pictures of largest error, of different objects as far as there are several, and one of middling error.
std::vector<int> PicturesToShow(const std::vector<DescribedPicture>& pictures) {
  std::vector<int> order(pictures.size());
  for (size_t k = 0; k < order.size(); ++k) order[k] = static_cast<int>(k);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return pictures[a].error.rmse_grey > pictures[b].error.rmse_grey; });
  std::vector<int> shown;
  for (const bool other_object : {true, false})
    for (const int k : order) {
      const bool known = std::any_of(shown.begin(), shown.end(), [&](int s) {
        return s == k || (other_object && pictures[s].error.object == pictures[k].error.object);
      });
      if (shown.size() < kPhotographResidualRules.worst_maps && !known) shown.push_back(k);
    }
  std::stable_sort(shown.begin(), shown.end(),
                   [&](int a, int b) { return pictures[a].error.rmse_grey > pictures[b].error.rmse_grey; });
  if (order.size() > kPhotographResidualRules.worst_maps) {
    const int middle = order[order.size() / 2];
    if (std::find(shown.begin(), shown.end(), middle) == shown.end()) shown.push_back(middle);
  }
  return shown;
}

}  // namespace

void DescribePhotographs(const images::Expectation& expectation, uint64_t seed, ThreadPool* pool,
                         images::PhotographDiagnosis* diagnosis) {
  const images::Photographs& photographs = expectation.photographs;
  if (photographs.size() == 0 || expectation.before.empty()) return;
  std::vector<DescribedPicture> pictures(photographs.size());
  ParallelFor(pool, photographs.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) pictures[k] = Describe(expectation, k);
  });
  MeanSilhouettes(pictures, diagnosis);
  diagnosis->photographs.clear();
  for (const DescribedPicture& picture : pictures) diagnosis->photographs.push_back(picture.error);
  std::stable_sort(diagnosis->photographs.begin(), diagnosis->photographs.end(),
                   [](const auto& a, const auto& b) { return a.image < b.image; });
  const std::vector<ResidualCovariate> covariates =
      ListPixelCovariates(photographs, expectation.before, pool);
  diagnosis->where =
      FindPhotographSlices(photographs, expectation.before, covariates, diagnosis->noise_floor.sigma);
  diagnosis->curves =
      PhotographCurves(photographs, expectation.before, expectation.after, covariates, seed, pool);
  diagnosis->maps.clear();
  for (const int k : PicturesToShow(pictures)) diagnosis->maps.push_back(MapOf(expectation, k));
}

}  // namespace touchstone::diagnosis::residuals
