#include "server/image/photograph/photo_image.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/image/scene/shading.h"

namespace touchstone::image {
namespace {

// As ideal as the renderer's camera; pixel centres at half-integers.
Intrinsics LensOf(const Camera& camera, const ImageOptions& options) {
  Intrinsics lens = PinholeIntrinsics(options.width, options.height, camera.vertical_fov_rad);
  lens.cx_px = 0.5 * options.width;
  lens.cy_px = 0.5 * options.height;
  return lens;
}

// The dark object on white of shading.h, of a picture without effects of photographs.
void MakeDarkOnWhite(const Photo& photo, std::vector<uint8_t>* pixels) {
  for (size_t i = 0; i < pixels->size(); ++i)
    (*pixels)[i] = photo.mask[i] == 0 ? 255 : static_cast<uint8_t>(photo.grey[i] * kDarkScale + 0.5f);
}

}  // namespace

bool ChangesPhotographs(const model::Model& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const model::EffectInstance& instance) {
    return instance.effect->of_photos() || instance.effect->moves_surface;
  });
}

absl::Status CheckPhotographStyle(const model::Model& model, const ImageOptions& options) {
  if (options.shading_style == ShadingStyle::kShaded) return absl::OkStatus();
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->of_photos())
      return absl::InvalidArgumentError(absl::StrCat(
          "image.shading_style is dark on white, and the model has the effect ", instance.effect->name,
          " of photographs, which acts on shaded pictures; ask for the shaded style, or take a model "
          "without effects of photographs"));
  return absl::OkStatus();
}

absl::StatusOr<Image> TakePhotograph(const std::shared_ptr<const model::Model>& model,
                                     const std::shared_ptr<const geometry::Surface>& surface,
                                     const Camera& camera, const ImageOptions& options,
                                     const PhotoNumber& number, PhotoWorkspace* workspace) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckPhotographStyle(*model, options));
  PhotoRequest request;
  request.surface = surface;
  request.object = surface->name();
  request.camera = camera;
  request.lens = LensOf(camera, options);
  request.seed = number.seed, request.index = number.index;
  PhotoOutputs outputs;
  outputs.pixels = true;
  outputs.details = options.depth;
  TOUCHSTONE_ASSIGN_OR_RETURN(Photo photo, PhotoSimulator(model).Run(request, outputs, workspace));
  if (options.shading_style == ShadingStyle::kDarkOnWhite) MakeDarkOnWhite(photo, &photo.pixels);

  Image image;
  image.width = photo.width, image.height = photo.height;
  image.channels = options.format == PixelFormat::kRgb ? 3 : 1;
  if (image.channels == 1) {
    image.pixels = std::move(photo.pixels);
  } else {
    for (const uint8_t grey : photo.pixels) image.pixels.insert(image.pixels.end(), 3, grey);
  }
  if (options.depth) image.depth_m = std::move(photo.depth_m);
  if (options.mask) image.mask = std::move(photo.mask);
  return image;
}

}  // namespace touchstone::image
