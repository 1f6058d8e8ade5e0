#include "server/image/normalize.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/image/normalize_region.h"
#include "server/image/shading.h"

namespace touchstone::image {
namespace {

constexpr double kMinObjectShare = 0.001, kMaxObjectShare = 0.9;  // of the picture
constexpr double kMaxRimShare =
    0.5;  // of the picture's rim: an object that takes more of it hides the ground
constexpr float kMinSteepness = 0.02f;  // of an outline, per pixel: fainter is noise or light
constexpr float kSmoothPx = 0.6f;
constexpr float kSmoothNoise = 0.2f;        // what is left of white noise then
constexpr double kMaxEnclosedShare = 0.08;  // of the object's pixels
constexpr double kMinShadowShare = 0.6;     // of a shadow's pixels, in its umbra
constexpr float kBrightShare = 0.98f;       // of the object's pixels, in grey: as bright as it gets

// Grey levels, the mean of the channels.
Plane GreyOf(const Image& image) {
  Plane grey(image.width, image.height);
  for (size_t k = 0; k < grey.values.size(); ++k) {
    const uint8_t* pixel = &image.pixels[k * image.channels];
    grey.values[k] = image.channels == 1 ? pixel[0] : (pixel[0] + pixel[1] + pixel[2]) / 3.0f;
  }
  return grey;
}

absl::Status CheckPicture(const Image& image, const char* name) {
  const size_t pixels = static_cast<size_t>(std::max(image.width, 0)) * std::max(image.height, 0);
  if (image.width < kMinNormalizedSide || image.height < kMinNormalizedSide || image.width > kMaxImageSide ||
      image.height > kMaxImageSide)
    return absl::InvalidArgumentError(absl::StrFormat("%s is %d x %d pixels; each side must be from %d to %d",
                                                      name, image.width, image.height, kMinNormalizedSide,
                                                      kMaxImageSide));
  if ((image.channels != 1 && image.channels != 3) || image.pixels.size() != pixels * image.channels)
    return absl::InvalidArgumentError(
        absl::StrFormat("%s has %d channels and %d bytes; grey or RGB was expected", name, image.channels,
                        image.pixels.size()));
  return absl::OkStatus();
}

Plane SlopeOf(const Plane& plane) {
  Plane slope(plane.width, plane.height);
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      const float across = plane.at(std::min(x + 1, plane.width - 1), y) - plane.at(std::max(x - 1, 0), y);
      const float down = plane.at(x, std::min(y + 1, plane.height - 1)) - plane.at(x, std::max(y - 1, 0));
      slope.at(x, y) = 0.5f * std::sqrt(across * across + down * down);
    }
  return slope;
}

// What differs from the ground, without what may be its shadow.
class Parting {
 public:
  // `calm`: the picture without its noise.
  Parting(const Plane& calm, const Plane& ground, float noise)
      : relative_(calm.width, calm.height), is_ground_(calm.width, calm.height) {
    // Grey levels near black say little: below the floor the logarithm becomes flat.
    const float floor = std::max(8.0f, 4 * noise), smooth_noise = kSmoothNoise * noise;
    const Plane smooth = Blurred(calm, kSmoothPx);
    for (size_t k = 0; k < calm.values.size(); ++k) {
      relative_.values[k] = std::log((smooth.values[k] + floor) / (ground.values[k] + floor));
      const float tolerance = (3.2f * smooth_noise + 1.2f) / (ground.values[k] + floor) + 0.02f;
      is_ground_.inside[k] = std::abs(relative_.values[k]) < tolerance;
      if (!is_ground_.inside[k]) different_ += std::abs(relative_.values[k]);
      mode_width_ += tolerance;
    }
    mode_width_ = 0.03f + 0.5f * mode_width_ / static_cast<float>(calm.values.size());
    slope_ = SlopeOf(relative_);
  }

  // The best region; empty if none has an outline.
  Region Best() {
    static constexpr float kLevels[] = {0.0f, 0.08f, 0.12f, 0.17f, 0.23f, 0.3f, 0.38f, 0.47f, 0.57f, 0.68f,
                                        0.8f, 0.95f, 1.1f,  1.3f,  1.5f,  1.8f, 2.1f,  2.5f,  1e9f};
    for (const float level : kLevels) Try(level);
    if (!best_.inside.empty()) best_ = Filled(best_);
    return best_;
  }

 private:
  // Ground that object and shadow enclose lies in the shadow too: what is as bright as lit ground there is the object.
  Region Filled(const Region& object) const {
    Region taken = object;
    for (size_t k = 0; k < taken.inside.size(); ++k)
      if (!is_ground_.inside[k] && relative_.values[k] < 0) taken.inside[k] = 1;
    return WithSmallHoles(object, taken, kMaxEnclosedShare);
  }

  // A shadow is darker than the ground, and everywhere by the same factor but for its rim.
  bool MayBeShadow(const Region& object) const {
    std::vector<float> values;
    const int width = object.width, height = object.height;
    const auto left_out = [&](int x, int y) {
      return !object.at(x, y) && !is_ground_.at(x, y) && relative_.at(x, y) < 0;
    };
    for (int y = 2; y + 2 < height; ++y)
      for (int x = 2; x + 2 < width; ++x)
        if (left_out(x, y) && left_out(x - 2, y) && left_out(x + 2, y) && left_out(x, y - 2) &&
            left_out(x, y + 2))
          values.push_back(relative_.at(x, y));
    if (values.size() < 30) return true;
    std::sort(values.begin(), values.end());
    size_t most = 0;
    for (size_t first = 0, last = 0; first < values.size(); ++first) {
      while (last < values.size() && values[last] <= values[first] + 2 * mode_width_) ++last;
      most = std::max(most, last - first);
    }
    return static_cast<double>(most) >= kMinShadowShare * static_cast<double>(values.size());
  }

  // Everything that is brighter than the ground, or darker than a shadow of this level.
  void Try(float level) {
    Region raw(relative_.width, relative_.height);
    for (size_t k = 0; k < raw.inside.size(); ++k)
      raw.inside[k] = !is_ground_.inside[k] && (relative_.values[k] > 0 || relative_.values[k] < -level);
    const Region region = Cleaned(raw, is_ground_);
    const double share = static_cast<double>(region.Count()) / static_cast<double>(region.inside.size());
    if (share < kMinObjectShare || share > kMaxObjectShare || RimShare(region) > kMaxRimShare) return;
    const float steepness = OutlineSteepness(region, slope_);
    if (steepness < kMinSteepness) return;
    double explained = 0;
    for (size_t k = 0; k < region.inside.size(); ++k)
      if (region.inside[k] && !is_ground_.inside[k]) explained += std::abs(relative_.values[k]);
    const double score = steepness * std::sqrt(explained / std::max(different_, 1e-9));
    if (score <= best_score_ || !MayBeShadow(region)) return;
    best_score_ = score;
    best_ = region;
  }

  Plane relative_, slope_;
  Region is_ground_, best_;
  double different_ = 0, best_score_ = 0;
  float mode_width_ = 0;
};

// The object as a white one is drawn dark on white; its light without the ground's unevenness.
void Paint(const Plane& grey, const Plane& ground, const Region& object, Image* picture) {
  double mean = 0;
  for (const float value : ground.values) mean += value;
  mean /= static_cast<double>(ground.values.size());
  std::vector<float> light(grey.values.size()), inside;
  for (size_t k = 0; k < light.size(); ++k) {
    if (!object.inside[k]) continue;
    // On a dark ground its light is not known.
    const float even =
        mean > 24 ? std::clamp(static_cast<float>(mean) / std::max(ground.values[k], 1.0f), 0.5f, 2.0f) : 1;
    light[k] = grey.values[k] * even;
    inside.push_back(light[k]);
  }
  if (inside.empty()) return;
  const auto bright =
      inside.begin() + static_cast<std::ptrdiff_t>(kBrightShare * static_cast<float>(inside.size() - 1));
  std::nth_element(inside.begin(), bright, inside.end());
  const float scale = 255 * kDarkScale / std::max(*bright, 1.0f);
  for (size_t k = 0; k < light.size(); ++k)
    if (object.inside[k])
      picture->pixels[k] = static_cast<uint8_t>(std::min(light[k] * scale, 255 * kDarkScale) + 0.5f);
}

}  // namespace

absl::StatusOr<Image> Normalize(const Image& photograph, const Image* background) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckPicture(photograph, "the photograph"));
  if (background != nullptr) {
    TOUCHSTONE_RETURN_IF_ERROR(CheckPicture(*background, "the background"));
    if (background->width != photograph.width || background->height != photograph.height)
      return absl::InvalidArgumentError(
          absl::StrFormat("the background is %d x %d pixels; %d x %d, as the photograph, "
                          "were expected",
                          background->width, background->height, photograph.width, photograph.height));
  }
  const Plane grey = GreyOf(photograph);
  const float noise = NoiseOf(grey);
  const Plane calm = WithoutNoise(grey, noise);
  const Plane ground =
      background == nullptr ? FitGround(calm, kSmoothNoise * noise) : GroundOf(GreyOf(*background), grey);
  Region object = Parting(calm, ground, noise).Best();
  Image picture;
  picture.width = photograph.width, picture.height = photograph.height, picture.channels = 1;
  picture.pixels.assign(grey.values.size(), 255);
  picture.mask.assign(grey.values.size(), 0);
  if (object.inside.empty()) return picture;
  object = Refined(object, grey);
  for (size_t k = 0; k < object.inside.size(); ++k) picture.mask[k] = object.inside[k] ? 255 : 0;
  Paint(grey, ground, object, &picture);
  return picture;
}

bool FoundObject(const Image& normalized) {
  return std::any_of(normalized.mask.begin(), normalized.mask.end(),
                     [](uint8_t value) { return value != 0; });
}

}  // namespace touchstone::image
