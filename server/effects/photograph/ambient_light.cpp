// Ambient light: light from all around, or less of it than the shading model has.
//   shade += level;  several add up
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double level;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {.field = &Parameters::level,
     .name = "level",
     .unit = Unit::kNone,
     .lower = -0.07,
     .upper = 2,
     .neutral = 0,
     .typical = 0.05,
     .meaning = "Added to the ambient term of the shade, in units of white; the nominal term is 0.07.",
     .least_claimed = 0},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.ambient += p.level;
}

}  // namespace

model::Effect AmbientLight() {
  return DefineEffect<Parameters>({
      .name = "ambient_light",
      .stage = model::Stage::kShading,
      .meaning = "Light of the room reaches every point of the object, from no particular side.",
      .signature =
          "The whole object is brighter by the same amount, deep in its dark sides too; the background "
          "stays black.",
      .check_on_rig = "Switch the lamps off and take a picture: what is left is ambient light.",
      .remedy = "Darken the room, or keep the effect.",
      .confounded_with =
          {
              {"background_level", "Look at the background: ambient light leaves it as it is."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
