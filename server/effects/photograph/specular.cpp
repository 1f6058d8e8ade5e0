// Specular: the surface shines. A Blinn-Phong highlight of the key light,
//   shade += strength * max(0, n . h)^exponent,  h halfway between the directions to the light and to the eye,
// where the key light stands above the surface (n . l > 0). Not multiplied by the strength of the light.
// Of several the strengths add up; the exponent is then their mean, weighted by strength.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double strength;
  double exponent;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::strength, "strength", Unit::kNone, 0, 5, 0, 0.2,
     "Light at the middle of the highlight, in units of white."},
    {&Parameters::exponent, "exponent", Unit::kNone, 1, 1000, 20, 20,
     "How narrow the highlight is: 5 satin, 100 polished."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  if (p.strength == 0) return;
  const double strength = photo.specular_strength + p.strength;
  photo.specular_exponent =
      (photo.specular_strength * photo.specular_exponent + p.strength * p.exponent) / strength;
  photo.specular_strength = strength;
}

}  // namespace

model::Effect Specular() {
  return DefineEffect<Parameters>({
      .name = "specular",
      .stage = model::Stage::kShading,
      .meaning = "The surface is glossy: it mirrors the key light.",
      .signature =
          "Bright spots on curved places where the surface looks halfway between the light and the eye; "
          "they move over the object as the camera does.",
      .check_on_rig =
          "Hold a polarising filter before the lens and turn it: highlights fade, matte shading stays.",
      .remedy =
          "Dull the surface with scanning spray, polarise light and lens crosswise, or keep the effect.",
      .confounded_with =
          {
              {"exposure", "Look at faces that turn away from the light: gloss leaves them as they are."},
              {"light_position",
               "Look at flat faces and dark sides: a highlight is narrow, a displaced light changes whole "
               "sides."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
