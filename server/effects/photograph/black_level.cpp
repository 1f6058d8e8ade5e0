// Black level: the camera adds a pedestal to every pixel, so that noise at black is not cut off.
//   recorded grey += grey, up to white, after the response and before the noise;  several add up
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double grey;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::grey, "grey", Unit::kGreyLevel, 0, 128, 0, 10,
     "Grey level that the camera records of no light."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.black_level_grey += p.grey;
}

}  // namespace

model::Effect BlackLevel() {
  return DefineEffect<Parameters>({
      .name = "black_level",
      .stage = model::Stage::kImageSensor,
      .meaning = "The camera adds a pedestal: it records no light as a grey level above 0.",
      .signature = "Every pixel is brighter by the same amount, the object and the ground behind it alike.",
      .check_on_rig = "Put the lens cap on and take a picture: its mean is the black level.",
      .remedy = "Set the camera's black level to 0, subtract it from the pictures, or keep the effect.",
      .confounded_with =
          {
              {"background_level", "Put the lens cap on: a pedestal stays, light of the ground is gone."},
              {"ambient_light", "Put the lens cap on: a pedestal stays, light of the room is gone."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
