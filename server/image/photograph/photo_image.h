// Photographs in the form that renderers give pictures: what a virtual source delivers where its model has effects of
// photographs.
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "server/image/image.h"
#include "server/image/photograph/simulate_photo.h"

namespace touchstone::image {

// Whether the model changes photographs: by effects of their stages, or by moving the surface.
bool ChangesPhotographs(const model::Model& model);

// Which photograph of a session or dataset: whose noise it draws.
struct PhotoNumber {
  uint64_t seed = 0, index = 0;
};

// The photograph of an ideal nominal pinhole (`camera.vertical_fov_rad`, its axis through the picture's middle), with the
// noise drawn and rounded; depth and mask where asked for. kRgb repeats the grey channel. Errors: those of
// PhotoSimulator::Run; INVALID_ARGUMENT for a dark object on white of a model with effects of photographs, which act on
// shaded pictures.
absl::StatusOr<Image> TakePhotograph(const std::shared_ptr<const model::Model>& model,
                                     const std::shared_ptr<const geometry::Surface>& surface,
                                     const Camera& camera, const ImageOptions& options,
                                     const PhotoNumber& number, PhotoWorkspace* workspace);

// That error alone, before any work.
absl::Status CheckPhotographStyle(const model::Model& model, const ImageOptions& options);

}  // namespace touchstone::image
