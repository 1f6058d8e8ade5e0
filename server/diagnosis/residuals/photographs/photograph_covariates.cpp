#include "server/diagnosis/residuals/photographs/photograph_covariates.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "server/base/units.h"
#include "server/diagnosis/residuals/photographs/photograph_silhouette.h"
#include "server/diagnosis/residuals/photographs/rules.h"
#include "server/image/scene/shading.h"

namespace touchstone::diagnosis::residuals {
namespace {

enum Part { kOutline, kObject, kGround };

// Part of the picture and side of the light, a byte each.
struct PartsOfPicture {
  std::vector<uint8_t> part, side;
};

PartsOfPicture PartsOf(const image::Photo& photo) {
  const int width = photo.width, height = photo.height;
  std::vector<char> object(photo.mask.size());
  double x_sum = 0, y_sum = 0, count = 0;
  for (size_t at = 0; at < object.size(); ++at) {
    object[at] = photo.mask[at] != 0;
    if (object[at]) x_sum += at % width, y_sum += at / width, ++count;
  }
  const std::vector<float> from_outline = SquaredDistances(OutlineOf(object, width, height), width, height);
  // Where the key light stands, seen in the picture: rows run downwards.
  const double right = image::kLights[0].right, down = -image::kLights[0].up;
  PartsOfPicture parts;
  parts.part.resize(object.size()), parts.side.resize(object.size());
  for (size_t at = 0; at < object.size(); ++at) {
    parts.part[at] =
        from_outline[at] <= kPhotographResidualRules.outline_px * kPhotographResidualRules.outline_px
            ? kOutline
        : object[at] ? kObject
                     : kGround;
    const double x = static_cast<double>(at % width) - x_sum / std::max(1.0, count),
                 y = static_cast<double>(at / width) - y_sum / std::max(1.0, count);
    parts.side[at] = !object[at] ? 2 : x * right + y * down > 0 ? 0 : 1;
  }
  return parts;
}

bool Varies(const ResidualCovariate& covariate, const images::Photographs& photographs) {
  double low = INFINITY, high = -INFINITY;
  const int pixels = photographs.width() * photographs.height();
  for (int k = 0; k < photographs.size(); ++k)
    for (int at = 0; at < pixels; at += std::max(1, pixels / 97)) {
      const double value = covariate.value(k, at);
      if (std::isnan(value)) continue;
      low = std::min(low, value), high = std::max(high, value);
    }
  return high > low;
}

}  // namespace

std::vector<float> PixelResiduals(const images::Photographs& photographs,
                                  const std::vector<image::Photo>& expected, int k) {
  std::vector<float> residuals = photographs.measured_grey[k];
  for (size_t at = 0; at < residuals.size(); ++at) residuals[at] -= expected[k].grey[at];
  return residuals;
}

std::vector<ResidualCovariate> ListPixelCovariates(const images::Photographs& photographs,
                                                   const std::vector<image::Photo>& expected,
                                                   ThreadPool* pool) {
  auto parts = std::make_shared<std::vector<PartsOfPicture>>(photographs.size());
  ParallelFor(pool, photographs.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) (*parts)[k] = PartsOf(expected[k]);
  });
  const int width = photographs.width();
  const session::CameraIntrinsics& camera = photographs.set->camera;
  const double half_diagonal = 0.5 * std::hypot(camera.width_px, camera.height_px);
  const auto on_object = [&expected](int k, int at) { return expected[k].mask[at] != 0; };
  std::vector<ResidualCovariate> all = {
      {"radius",
       "radius",
       "",
       {},
       [=](int, int at) {
         return std::hypot(at % width + 0.5 - camera.cx_px, at / width + 0.5 - camera.cy_px) / half_diagonal;
       }},
      {"column", "column", "px", {}, [=](int, int at) { return at % width + 0.5; }},
      {"row", "row", "px", {}, [=](int, int at) { return at / width + 0.5; }},
      {"grey", "expected grey", "", {}, [&expected](int k, int at) { return expected[k].grey[at]; }},
      {"incidence_deg",
       "incidence",
       "deg",
       {},
       [&expected, on_object](int k, int at) {
         return on_object(k, at) ? expected[k].incidence_rad[at] / kRadiansPerDegree : NAN;
       }},
      {"depth_mm",
       "depth",
       "mm",
       {},
       [&expected, on_object](int k, int at) {
         return on_object(k, at) ? expected[k].depth_m[at] * kMillimetresPerMetre : NAN;
       }},
      {"part",
       "part",
       "",
       {"outline", "object", "ground"},
       [parts](int k, int at) { return (*parts)[k].part[at]; }},
      {"light_side",
       "side",
       "",
       {"towards the light", "away from the light"},
       [parts](int k, int at) {
         const int side = (*parts)[k].side[at];
         return side == 2 ? NAN : side;
       }},
      {"object", "object", "", photographs.objects,
       [&photographs](int k, int) { return photographs.object[k]; }}};
  if (photographs.set->has_session_time)
    all.push_back({"session_time_s", "session time", "s", {}, [&photographs](int k, int) {
                     return photographs.TimeOf(k);
                   }});
  all.erase(std::remove_if(all.begin(), all.end(),
                           [&](const auto& covariate) { return !Varies(covariate, photographs); }),
            all.end());
  return all;
}

}  // namespace touchstone::diagnosis::residuals
