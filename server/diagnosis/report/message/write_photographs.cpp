// Outlines and pictures side by side.
#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/diagnosis/report/message/rules.h"
#include "server/diagnosis/report/message/write_data_report.h"
#include "server/image/encoding/encode.h"

namespace touchstone::diagnosis::report {
namespace {

std::string PngOf(const std::vector<uint8_t>& pixels, int width, int height, int channels) {
  absl::StatusOr<std::string> png = image::EncodePng(pixels.data(), width, height, channels);
  TOUCHSTONE_CHECK(png.ok());
  return *std::move(png);
}

void WriteMap(const images::PhotographMap& map, v1::PhotographMap* message) {
  message->set_image(map.image);
  message->set_object(map.object);
  const int width = map.width, height = map.height;
  message->set_measured_png(PngOf(map.measured, width, height, 1));
  message->set_before_png(PngOf(map.before, width, height, 1));
  message->set_after_png(PngOf(map.after, width, height, 1));
  // One scale for both, so that what has fallen looks as if it had.
  std::vector<float> sizes = map.residual_before_grey;
  for (float& size : sizes) size = std::abs(size);
  const size_t place =
      std::min(sizes.size() - 1, static_cast<size_t>(kMessageRules.scale_share * sizes.size()));
  std::nth_element(sizes.begin(), sizes.begin() + place, sizes.end());
  const double scale =
      std::max(kMessageRules.min_scale_grey.value(), std::ceil(static_cast<double>(sizes[place])));
  message->set_residual_scale(scale);
  message->set_residual_before_png(PngOf(ResidualColours(map.residual_before_grey, scale), width, height, 3));
  message->set_residual_after_png(PngOf(ResidualColours(map.residual_after_grey, scale), width, height, 3));
}

}  // namespace

std::vector<uint8_t> ResidualColours(const std::vector<float>& residual_grey, double scale_grey) {
  std::vector<uint8_t> rgb(3 * residual_grey.size());
  for (size_t at = 0; at < residual_grey.size(); ++at) {
    const double share = std::clamp(residual_grey[at] / scale_grey, -1.0, 1.0);
    const uint8_t pale = static_cast<uint8_t>(std::lround(255 * (1 - std::abs(share))));
    rgb[3 * at] = share < 0 ? pale : 255;
    rgb[3 * at + 1] = pale;
    rgb[3 * at + 2] = share > 0 ? pale : 255;
  }
  return rgb;
}

void WritePhotographs(const PhotographDescription& photographs, v1::PhotographSummary* message) {
  message->set_silhouette_iou(photographs.silhouette_iou);
  message->set_silhouette_iou_after(photographs.silhouette_iou_after);
  message->set_contour_distance_px(photographs.contour_distance_px);
  message->set_contour_distance_after_px(photographs.contour_distance_after_px);
  for (const images::PhotographError& error : photographs.photographs) {
    v1::PhotographError* to = message->add_photographs();
    to->set_image(error.image);
    to->set_object(error.object);
    to->set_rmse(error.rmse_grey);
    to->set_rmse_after(error.rmse_after_grey);
    to->set_mean_residual(error.mean_residual_grey);
    to->set_silhouette_iou(error.silhouette_iou);
    to->set_contour_distance_px(error.contour_distance_px);
  }
  for (const images::PhotographMap& map : photographs.maps)
    if (!map.residual_before_grey.empty()) WriteMap(map, message->add_maps());
}

}  // namespace touchstone::diagnosis::report
