#include "server/image/photo_sensor.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_format.h>

#include "server/base/random.h"
#include "server/base/units.h"
#include "server/image/photo_power.h"

namespace touchstone::image {
namespace {

constexpr double kFloatGrey = 255.0;
constexpr double kGaussianReach = 5.0;  // in sigmas: the rest is 6e-7

void Vignette(double strength, const PhotoLens& lens, std::vector<float>* light) {
  const double half_diagonal_px = 0.5 * std::hypot(lens.width, lens.height);
  const float scale = static_cast<float>(1.0 / half_diagonal_px);
  const float cx = static_cast<float>(lens.cx), cy = static_cast<float>(lens.cy);
  const float lost = static_cast<float>(strength);
  for (int row = 0; row < lens.height; ++row) {
    const float y = (row + 0.5f - cy) * scale;
    float* const line = &(*light)[static_cast<size_t>(row) * lens.width];
    for (int column = 0; column < lens.width; ++column) {
      const float x = (column + 0.5f - cx) * scale;
      const float left = 1.0f - lost * (x * x + y * y);
      line[column] *= left > 0.0f ? left : 0.0f;
    }
  }
}

std::vector<float> GaussianWeights(double sigma_px) {
  const int reach = static_cast<int>(std::ceil(kGaussianReach * sigma_px));
  std::vector<double> weights(reach + 1);
  double sum = 0;
  for (int i = 0; i <= reach; ++i) {
    weights[i] = std::exp(-0.5 * i * i / (sigma_px * sigma_px));
    sum += i == 0 ? weights[i] : 2 * weights[i];
  }
  std::vector<float> result;
  for (double weight : weights) result.push_back(static_cast<float>(weight / sum));
  return result;
}

// A picture with its border repeated outwards, so that taps need no checks.
struct Padded {
  int reach, stride;
  std::vector<float> values;
  const float* At(int row, int column) const {
    return &values[static_cast<size_t>(row + reach) * stride + column + reach];
  }
};
Padded Pad(const std::vector<float>& light, int width, int height, int reach) {
  Padded padded{reach, width + 2 * reach, {}};
  padded.values.resize(static_cast<size_t>(padded.stride) * (height + 2 * reach));
  for (int row = -reach; row < height + reach; ++row) {
    const float* const from = &light[static_cast<size_t>(std::clamp(row, 0, height - 1)) * width];
    float* const to = &padded.values[static_cast<size_t>(row + reach) * padded.stride];
    std::fill_n(to, reach, from[0]);
    std::copy_n(from, width, to + reach);
    std::fill_n(to + reach + width, reach, from[width - 1]);
  }
  return padded;
}

void AddScaled(const float* from, float weight, int count, float* to) {
  for (int i = 0; i < count; ++i) to[i] += weight * from[i];
}

void Defocus(double sigma_px, const PhotoLens& lens, std::vector<float>* light) {
  const std::vector<float> weights = GaussianWeights(sigma_px);
  const int reach = static_cast<int>(weights.size()) - 1;
  if (reach == 0) return;
  const int width = lens.width, height = lens.height;
  const Padded padded = Pad(*light, width, height, reach);
  // Down the columns, then along the rows.
  std::vector<float> line(padded.stride);
  for (int row = 0; row < height; ++row) {
    std::fill(line.begin(), line.end(), 0.0f);
    for (int i = -reach; i <= reach; ++i)
      AddScaled(padded.At(row + i, -reach), weights[std::abs(i)], padded.stride, line.data());
    float* const result = &(*light)[static_cast<size_t>(row) * width];
    std::fill_n(result, width, 0.0f);
    for (int i = -reach; i <= reach; ++i)
      AddScaled(line.data() + reach + i, weights[std::abs(i)], width, result);
  }
}

void MoveDuringExposure(double length_px, double angle_rad, const PhotoLens& lens,
                        std::vector<float>* light) {
  const std::vector<MotionTap> taps = MotionKernel(length_px, angle_rad);
  int reach = 0;
  for (const MotionTap& tap : taps) reach = std::max({reach, std::abs(tap.right), std::abs(tap.down)});
  if (reach == 0) return;
  const Padded padded = Pad(*light, lens.width, lens.height, reach);
  std::fill(light->begin(), light->end(), 0.0f);
  for (int row = 0; row < lens.height; ++row)
    for (const MotionTap& tap : taps)
      AddScaled(padded.At(row + tap.down, tap.right), tap.weight, lens.width,
                &(*light)[static_cast<size_t>(row) * lens.width]);
}

void ExposeAndRespond(double exposure_factor, double gamma, std::vector<float>* light) {
  const float factor = static_cast<float>(exposure_factor), white = static_cast<float>(kFloatGrey);
  float* const values = light->data();
  const size_t count = light->size();
  if (gamma == 1) {
    for (size_t i = 0; i < count; ++i) {
      const float exposed = values[i] * factor;
      values[i] = white * (exposed < 1.0f ? exposed : 1.0f);
    }
    return;
  }
  const float exponent = static_cast<float>(gamma);
  for (size_t i = 0; i < count; ++i) {
    const float exposed = values[i] * factor;
    values[i] = white * PowerOf(exposed < 1.0f ? exposed : 1.0f, exponent);
  }
}

float SrgbOf(float light) {
  return light <= 0.0031308f ? 12.92f * light : 1.055f * PowerOf(light, 1 / 2.4f) - 0.055f;
}

// sRGB's curve, or a mean of it and none, of recorded grey levels.
void WriteSrgb(double share, std::vector<float>* grey) {
  const float white = static_cast<float>(kFloatGrey), part = static_cast<float>(share);
  for (float& value : *grey) value += part * (white * SrgbOf(value / white) - value);
}

void AddPedestal(double black_level_grey, std::vector<float>* grey) {
  const float white = static_cast<float>(kFloatGrey), pedestal = static_cast<float>(black_level_grey);
  for (float& value : *grey) value = std::min(value + pedestal, white);
}

absl::Status AddTerms(const effects::PhotoSettings& settings, const PhotoLens& lens,
                      const PixelSurface& surface, double session_time_s, std::vector<float>* grey) {
  const double half_diagonal_px = 0.5 * std::hypot(lens.width, lens.height);
  effects::PhotoPixel pixel;
  pixel.session_time_s = session_time_s;
  for (int row = 0; row < lens.height; ++row) {
    for (int column = 0; column < lens.width; ++column) {
      const size_t i = static_cast<size_t>(row) * lens.width + column;
      pixel.column = column + 0.5, pixel.row = row + 0.5;
      pixel.radius = std::hypot(pixel.column - lens.cx, pixel.row - lens.cy) / half_diagonal_px;
      pixel.incidence_deg = surface.incidence_rad[i] / kRadiansPerDegree;
      pixel.depth_mm = surface.depth_m[i] * kMillimetresPerMetre;
      for (const auto& term : settings.added_grey) {
        pixel.grey = (*grey)[i];
        const double added = term(pixel);
        if (!std::isfinite(added))
          return absl::InvalidArgumentError(
              absl::StrFormat("an effect of the model that adds grey gives %g in row %d, column %d of a "
                              "photograph; must be a "
                              "finite number",
                              added, row, column));
        (*grey)[i] = static_cast<float>(std::clamp(pixel.grey + added, 0.0, kFloatGrey));
      }
    }
  }
  return absl::OkStatus();
}

// The mean of max(0, 1 - |right|) max(0, 1 - |down|) over a straight piece on which it is a polynomial of the second
// degree: Simpson's rule is exact.
double MeanTent(double right, double down, double step_right, double step_down, double from, double to) {
  const auto tent = [&](double t) {
    return std::max(0.0, 1 - std::abs(t * step_right - right)) *
           std::max(0.0, 1 - std::abs(t * step_down - down));
  };
  return (to - from) / 6 * (tent(from) + 4 * tent(0.5 * (from + to)) + tent(to));
}

}  // namespace

std::vector<MotionTap> MotionKernel(double length_px, double angle_rad) {
  if (!(length_px > 0)) return {{0, 0, 1.0f}};
  const double step_right = std::cos(angle_rad), step_down = -std::sin(angle_rad);
  const double half = 0.5 * length_px;
  // Between two crossings of the lines through pixel centres, the weights of the neighbours are polynomials.
  std::vector<double> crossings = {-half, half};
  for (const double step : {step_right, step_down}) {
    const int reach = static_cast<int>(std::floor(half * std::abs(step)));
    for (int k = -reach; k <= reach; ++k)
      if (std::abs(step) > 1e-12) crossings.push_back(std::clamp(k / step, -half, half));
  }
  std::sort(crossings.begin(), crossings.end());

  const int reach_right = static_cast<int>(std::ceil(half * std::abs(step_right) - 1e-12));
  const int reach_down = static_cast<int>(std::ceil(half * std::abs(step_down) - 1e-12));
  std::vector<MotionTap> taps;
  for (int down = -reach_down; down <= reach_down; ++down) {
    for (int right = -reach_right; right <= reach_right; ++right) {
      double weight = 0;
      for (size_t i = 0; i + 1 < crossings.size(); ++i)
        weight += MeanTent(right, down, step_right, step_down, crossings[i], crossings[i + 1]);
      if (weight > 0) taps.push_back({right, down, static_cast<float>(weight / length_px)});
    }
  }
  return taps;
}

absl::Status RecordLight(const effects::PhotoSettings& settings, const PhotoLens& lens,
                         const PixelSurface& surface, double session_time_s, std::vector<float>* light) {
  if (settings.vignetting != 0) Vignette(settings.vignetting, lens, light);
  if (settings.defocus_sigma_px > 0) Defocus(settings.defocus_sigma_px, lens, light);
  if (settings.motion_length_px > 0)
    MoveDuringExposure(settings.motion_length_px, settings.motion_angle_rad, lens, light);
  ExposeAndRespond(settings.exposure_factor, settings.gamma, light);
  if (settings.srgb_share > 0) WriteSrgb(settings.srgb_share, light);
  if (settings.black_level_grey > 0) AddPedestal(settings.black_level_grey, light);
  if (settings.added_grey.empty()) return absl::OkStatus();
  return AddTerms(settings, lens, surface, session_time_s, light);
}

void DrawPixels(const effects::PhotoSettings& settings, const std::vector<float>& grey, uint64_t seed,
                uint64_t index, std::vector<uint8_t>* pixels) {
  pixels->resize(grey.size());
  const double variance = settings.noise_sigma_grey * settings.noise_sigma_grey;
  const double gain = settings.noise_gain;
  std::vector<double> normals;
  if (variance > 0 || gain > 0) {
    normals.resize(grey.size());
    FillNormals(seed, RandomDomain::kImage, &index, 1, static_cast<int>(grey.size()), normals.data());
  }
  for (size_t i = 0; i < grey.size(); ++i) {
    double value = grey[i];
    if (!normals.empty()) value += std::sqrt(variance + gain * value) * normals[i];
    (*pixels)[i] = static_cast<uint8_t>(std::clamp(std::floor(value + 0.5), 0.0, kFloatGrey));
  }
}

}  // namespace touchstone::image
