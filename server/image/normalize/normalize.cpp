#include "server/image/normalize/normalize.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/image/normalize/normalize_parting.h"
#include "server/image/normalize/normalize_region.h"
#include "server/image/scene/shading.h"

namespace touchstone::image {
namespace {

constexpr float kBrightShare = 0.98f;  // of the object's pixels, in grey: as bright as it gets

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

bool IsGrey(const Image& image) {
  for (size_t k = 0; k + 2 < image.pixels.size(); k += 3)
    if (image.pixels[k] != image.pixels[k + 1] || image.pixels[k] != image.pixels[k + 2]) return false;
  return true;
}

// One plane of a picture without colour, else three.
std::vector<Plane> ChannelsOf(const Image& image, bool grey) {
  if (grey) return {GreyOf(image)};
  std::vector<Plane> channels(3, Plane(image.width, image.height));
  for (size_t k = 0; k < image.pixels.size(); ++k) channels[k % 3].values[k / 3] = image.pixels[k];
  return channels;
}

GroundedPicture FindGround(const Image& photograph, const Image* background) {
  GroundedPicture picture;
  const bool grey =
      photograph.channels == 1 || IsGrey(photograph) || (background != nullptr && background->channels == 1);
  picture.grey = ChannelsOf(photograph, grey);
  for (const Plane& channel : picture.grey) picture.noise = std::max(picture.noise, NoiseOf(channel));
  const std::vector<Plane> empty =
      background == nullptr ? std::vector<Plane>() : ChannelsOf(*background, grey);
  for (size_t c = 0; c < picture.channels(); ++c) {
    picture.calm.push_back(WithoutNoise(picture.grey[c], picture.noise));
    picture.ground.push_back(background == nullptr ? FitGround(picture.calm[c], kCalmNoise * picture.noise)
                                                   : GroundOf(empty[c], picture.grey[c]));
  }
  return picture;
}

Plane MeanOf(const std::vector<Plane>& planes) {
  Plane mean = planes[0];
  if (planes.size() == 1) return mean;
  for (size_t k = 0; k < mean.values.size(); ++k)
    mean.values[k] = (planes[0].values[k] + planes[1].values[k] + planes[2].values[k]) / 3.0f;
  return mean;
}

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
  const GroundedPicture grounded = FindGround(photograph, background);
  Region object = PartFromGround(grounded);
  Image picture;
  picture.width = photograph.width, picture.height = photograph.height, picture.channels = 1;
  picture.pixels.assign(grounded.grey[0].values.size(), 255);
  picture.mask.assign(picture.pixels.size(), 0);
  if (object.inside.empty()) return picture;
  object = Refined(object, grounded.grey);
  for (size_t k = 0; k < object.inside.size(); ++k) picture.mask[k] = object.inside[k] ? 255 : 0;
  Paint(GreyOf(photograph), MeanOf(grounded.ground), object, &picture);
  return picture;
}

bool FoundObject(const Image& normalized) {
  return std::any_of(normalized.mask.begin(), normalized.mask.end(),
                     [](uint8_t value) { return value != 0; });
}

}  // namespace touchstone::image
