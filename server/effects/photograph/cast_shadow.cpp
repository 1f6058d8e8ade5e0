// Cast shadow: parts of the object stand in the way of the key light.
//   key light at a point = nominal * (1 - strength)  where the way to it meets the object
// The highlight of `specular` is part of the key light. Of several, the shares of light that pass multiply.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double strength;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::strength, "strength", Unit::kNone, 0, 1, 0, 0.5,
     "Share of the key light that points in its shadow lose; 1: all of it."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.shadow_strength = 1 - (1 - photo.shadow_strength) * (1 - p.strength);
}

}  // namespace

model::Effect CastShadow() {
  return DefineEffect<Parameters>({
      .name = "cast_shadow",
      .stage = model::Stage::kShading,
      .meaning = "The object casts shadows on itself, which the nominal shading leaves out.",
      .signature =
          "Dark places with sharp borders beside parts that stand out, on the side away from the key "
          "light.",
      .check_on_rig =
          "Hold a stick before the object in the light: if its shadow is sharp and dark, the object "
          "throws its own as well.",
      .remedy = "Light the object from all sides (a ring or a tent), or keep the effect.",
      .confounded_with =
          {
              {"ambient_light",
               "Look at convex objects and at faces that see the light: shadows lie only behind parts that "
               "stand out."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
