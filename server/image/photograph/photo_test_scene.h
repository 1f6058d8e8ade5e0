// Models, requests and pictures for the tests of photographs.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/effects/all_effects.h"
#include "server/image/photograph/simulate_photo.h"
#include "server/image/renderers/test_scene.h"
#include "server/model/model.h"

namespace touchstone::image {

using EffectLines = std::vector<std::pair<std::string, std::vector<std::string>>>;

// {{"exposure", {"stops=1"}}, ...} as a model.
inline std::shared_ptr<const model::Model> PhotoModel(const EffectLines& lines) {
  model::Model model = model::NominalModel();
  for (const auto& [effect, assignments] : lines) {
    auto added = model::AddEffect(model, effect, assignments, effects::Catalogue());
    if (!added.ok()) {
      ADD_FAILURE() << added.status().message();
      continue;
    }
    model = *std::move(added);
  }
  return std::make_shared<const model::Model>(std::move(model));
}

// A pinhole of 45 deg, its axis through the middle, pixel centres at half-integers.
inline Intrinsics IdealLens(int width, int height) {
  Intrinsics lens = PinholeIntrinsics(width, height, Camera().vertical_fov_rad);
  lens.cx_px = 0.5 * width, lens.cy_px = 0.5 * height;
  return lens;
}

inline PhotoRequest RequestOf(const std::shared_ptr<const geometry::Surface>& surface, const Camera& camera,
                              int width = 120, int height = 90) {
  PhotoRequest request;
  request.surface = surface;
  request.object = surface->name();
  request.camera = camera;
  request.lens = IdealLens(width, height);
  return request;
}

inline Photo MustPhotograph(const std::shared_ptr<const model::Model>& model, const PhotoRequest& request,
                            PhotoWorkspace* workspace = nullptr) {
  PhotoOutputs outputs;
  outputs.pixels = outputs.details = true;
  auto photo = PhotoSimulator(model).Run(request, outputs, workspace);
  if (photo.ok()) return *std::move(photo);
  ADD_FAILURE() << photo.status().message();
  return {};
}
inline Photo MustPhotograph(const EffectLines& lines, const PhotoRequest& request) {
  return MustPhotograph(PhotoModel(lines), request);
}

}  // namespace touchstone::image
