// The lens of a board's pictures, as a model makes it of the nominal one, and what a lens may do.
#pragma once

#include <memory>
#include <vector>

#include "server/image/photograph/photo_lens.h"
#include "server/model/model.h"
#include "server/session/images/image_set.h"

namespace touchstone::diagnosis::boards {

// The catalogue's effects of the projection.
std::vector<std::shared_ptr<const model::Effect>> NamedLensEffects();

// What a lens may do besides: tangential distortion, radial distortion of sixth order, pixels that are not square.
// Effects of no model file: only LensOfModel knows what they do.
std::vector<std::shared_ptr<const model::Effect>> NamelessLensEffects();

// A model with another's effects behind its own.
model::Model WithEffectsOf(model::Model model, const model::Model& other);

// The nominal lens with what the effects of either list do.
image::PhotoLens LensOfModel(const session::CameraIntrinsics& nominal, const model::Model& model);

}  // namespace touchstone::diagnosis::boards
