#include "server/image/photograph/photo_sensor.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_format.h>

#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/image/photograph/photo_power.h"

namespace touchstone::image {
namespace {

constexpr double kFloatGrey = 255.0;
constexpr double kGaussianReach = 5.0;  // in sigmas: the rest is 6e-7

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

// What is worked on of a picture: outside the box its light is the ground's, whose records are worked out once.
struct Part {
  int width = 0, height = 0;  // of the picture
  PixelBox box;
  std::vector<float>* light;

  int columns() const { return box.last_column - box.first_column; }
  float* Row(int row) const { return &(*light)[static_cast<size_t>(row) * width + box.first_column]; }
  template <typename Act>
  void ForRows(const Act& act) const {  // act(values, count)
    for (int row = box.first_row; row < box.last_row; ++row) act(Row(row), columns());
  }
};

void Vignette(double strength, const PhotoLens& lens, const Part& part) {
  const double half_diagonal_px = 0.5 * std::hypot(lens.width, lens.height);
  const float scale = static_cast<float>(1.0 / half_diagonal_px);
  const float cx = static_cast<float>(lens.cx), cy = static_cast<float>(lens.cy);
  const float lost = static_cast<float>(strength);
  for (int row = part.box.first_row; row < part.box.last_row; ++row) {
    const float y = (row + 0.5f - cy) * scale;
    float* const line = &(*part.light)[static_cast<size_t>(row) * lens.width];
    for (int column = part.box.first_column; column < part.box.last_column; ++column) {
      const float x = (column + 0.5f - cx) * scale;
      const float left = 1.0f - lost * (x * x + y * y);
      line[column] *= left > 0.0f ? left : 0.0f;
    }
  }
}

// The part with a border of `reach` more, the picture's own border repeated outwards, so that taps need no checks.
struct Padded {
  int reach, stride;
  PixelBox box;
  std::vector<float> values;
  const float* At(int row, int column) const {
    return &values[static_cast<size_t>(row - box.first_row + reach) * stride + column - box.first_column +
                   reach];
  }
};
Padded Pad(const Part& part, int reach) {
  const PixelBox& box = part.box;
  const int first = box.first_column - reach, last = box.last_column + reach;
  const int before = std::max(0, -first), after = std::max(0, last - part.width);
  Padded padded{reach, last - first, box, {}};
  padded.values.resize(static_cast<size_t>(padded.stride) * (box.last_row - box.first_row + 2 * reach));
  float* to = padded.values.data();
  for (int row = box.first_row - reach; row < box.last_row + reach; ++row, to += padded.stride) {
    const float* const from =
        &(*part.light)[static_cast<size_t>(std::clamp(row, 0, part.height - 1)) * part.width];
    std::fill_n(to, before, from[0]);
    std::copy_n(from + first + before, padded.stride - before - after, to + before);
    std::fill_n(to + padded.stride - after, after, from[part.width - 1]);
  }
  return padded;
}

void AddScaled(const float* from, float weight, int count, float* to) {
  for (int i = 0; i < count; ++i) to[i] += weight * from[i];
}

void Defocus(const std::vector<float>& weights, const Part& part) {
  const int reach = static_cast<int>(weights.size()) - 1;
  if (reach <= 0) return;
  const int columns = part.columns(), first = part.box.first_column;
  const Padded padded = Pad(part, reach);
  // Down the columns, then along the rows.
  std::vector<float> line(padded.stride);
  for (int row = part.box.first_row; row < part.box.last_row; ++row) {
    std::fill(line.begin(), line.end(), 0.0f);
    for (int i = -reach; i <= reach; ++i)
      AddScaled(padded.At(row + i, first - reach), weights[std::abs(i)], padded.stride, line.data());
    float* const result = part.Row(row);
    std::fill_n(result, columns, 0.0f);
    for (int i = -reach; i <= reach; ++i)
      AddScaled(line.data() + reach + i, weights[std::abs(i)], columns, result);
  }
}

int ReachOf(const std::vector<MotionTap>& taps) {
  int reach = 0;
  for (const MotionTap& tap : taps) reach = std::max({reach, std::abs(tap.right), std::abs(tap.down)});
  return reach;
}

void MoveDuringExposure(const std::vector<MotionTap>& taps, const Part& part) {
  const int reach = ReachOf(taps);
  if (reach == 0) return;
  const Padded padded = Pad(part, reach);
  for (int row = part.box.first_row; row < part.box.last_row; ++row) {
    float* const result = part.Row(row);
    std::fill_n(result, part.columns(), 0.0f);
    for (const MotionTap& tap : taps)
      AddScaled(padded.At(row + tap.down, part.box.first_column + tap.right), tap.weight, part.columns(),
                result);
  }
}

void ExposeAndRespond(double exposure_factor, double gamma, float* values, int count) {
  const float factor = static_cast<float>(exposure_factor), white = static_cast<float>(kFloatGrey);
  if (gamma == 1) {
    for (int i = 0; i < count; ++i) {
      const float exposed = values[i] * factor;
      values[i] = white * (exposed < 1.0f ? exposed : 1.0f);
    }
    return;
  }
  const float exponent = static_cast<float>(gamma);
  for (int i = 0; i < count; ++i) {
    const float exposed = values[i] * factor;
    values[i] = white * PowerOf(exposed < 1.0f ? exposed : 1.0f, exponent);
  }
}

float SrgbOf(float light) {
  return light <= 0.0031308f ? 12.92f * light : 1.055f * PowerOf(light, 1 / 2.4f) - 0.055f;
}

// sRGB's curve, or a mean of it and none, of recorded grey levels.
void WriteSrgb(double share, float* values, int count) {
  const float white = static_cast<float>(kFloatGrey), part = static_cast<float>(share);
  for (int i = 0; i < count; ++i) values[i] += part * (white * SrgbOf(values[i] / white) - values[i]);
}

void AddPedestal(double black_level_grey, float* values, int count) {
  const float white = static_cast<float>(kFloatGrey), pedestal = static_cast<float>(black_level_grey);
  for (int i = 0; i < count; ++i) values[i] = std::min(values[i] + pedestal, white);
}

// Of a part whose vignetting is done.
void BlurAndRespond(const effects::PhotoSettings& settings, const std::vector<float>& defocus,
                    const std::vector<MotionTap>& motion, const Part& part) {
  Defocus(defocus, part);
  MoveDuringExposure(motion, part);
  part.ForRows([&](float* values, int count) {
    ExposeAndRespond(settings.exposure_factor, settings.gamma, values, count);
    if (settings.srgb_share > 0) WriteSrgb(settings.srgb_share, values, count);
    if (settings.black_level_grey > 0) AddPedestal(settings.black_level_grey, values, count);
  });
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

absl::StatusOr<PixelBox> RecordLight(const effects::PhotoSettings& settings, const PhotoLens& lens,
                                     const PixelSurface& surface, double session_time_s,
                                     const PixelBox& object, std::vector<float>* light) {
  std::vector<float> defocus;
  if (settings.defocus_sigma_px > 0) defocus = GaussianWeights(settings.defocus_sigma_px);
  std::vector<MotionTap> motion;
  if (settings.motion_length_px > 0)
    motion = MotionKernel(settings.motion_length_px, settings.motion_angle_rad);
  const float ground = static_cast<float>(settings.background_light);
  Part part{lens.width, lens.height, {0, 0, lens.width, lens.height}, light};
  // Most pixels of a picture see the ground. It differs from place to place where light falls off towards the corners,
  // unless it is black.
  if (settings.vignetting == 0 || ground == 0) {
    const int reach = std::max(static_cast<int>(defocus.size()) - 1, 0) + ReachOf(motion);
    part.box = {std::max(object.first_column - reach, 0), std::max(object.first_row - reach, 0),
                std::min(object.last_column + reach, lens.width),
                std::min(object.last_row + reach, lens.height)};
  }
  if (settings.vignetting != 0) Vignette(settings.vignetting, lens, part);
  BlurAndRespond(settings, defocus, motion, part);
  std::vector<float> one = {ground};
  BlurAndRespond(settings, defocus, motion, {1, 1, {0, 0, 1, 1}, &one});
  if (one[0] != ground) FillAround(part.box, one[0], lens.width, light);
  if (settings.added_grey.empty()) return part.box;
  TOUCHSTONE_RETURN_IF_ERROR(AddTerms(settings, lens, surface, session_time_s, light));
  return PixelBox{0, 0, lens.width, lens.height};
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
