// Vignetting: the corners of the picture are darker than its middle.
//   light *= 1 - strength * r^2,  r: distance from the principal point over half the image's diagonal
// In linear light, not below 0; the strengths of several add up.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double strength;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::strength, "strength", Unit::kNone, -1, 1, 0, 0.2,
     "Share of the light that is lost at the distance of half a diagonal."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.vignetting += p.strength;
}

}  // namespace

model::Effect Vignetting() {
  return DefineEffect<Parameters>({
      .name = "vignetting",
      .stage = model::Stage::kImageSensor,
      .meaning = "The lens passes less light towards the corners of the picture.",
      .signature = "Everything far from the middle is darker by a share that grows with the square of the "
                   "distance; an object that moves through the picture changes its grey levels.",
      .check_on_rig = "Photograph an evenly lit white sheet.",
      .remedy = "Close the aperture by two stops, or divide by the picture of a white sheet.",
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
