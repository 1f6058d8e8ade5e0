// Light position: the key light stands elsewhere than the shading model puts it.
//   position = nominal + offset, in the axes of the commanded camera's picture: right, up, towards the eye
// Several add up.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  Eigen::Vector3d offset_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::offset_m, "offset_mm", Unit::kMillimetre, -2000, 2000, 0, 20,
     "How far the key light stands off: right, up, towards the eye."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.key_light_offset_m += p.offset_m;
}

}  // namespace

model::Effect LightPosition() {
  return DefineEffect<Parameters>({
      .name = "light_position",
      .stage = model::Stage::kShading,
      .meaning = "The key light stands displaced against its place in the lighting model.",
      .signature = "Faces that look to one side are too bright, those that look to the other too dark; "
                   "silhouettes stay.",
      .check_on_rig = "Hold a glossy ball into the picture and see where the highlight lies.",
      .remedy = "Fix the lamp to the camera, measure its place, or keep the effect.",
      .confounded_with =
          {
              {"camera_rotation",
               "Look at the silhouettes: a turned camera moves them, a displaced light changes only grey "
               "levels within them."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
