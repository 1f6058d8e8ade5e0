// Exposure: more or less light than nominal reaches the image sensor.
//   light = min(1, light * 2^stops);  several add up
#include <cmath>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double stops;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::stops, "stops", Unit::kNone, -8, 8, 0, 0.3, "Doublings of the light; -1 is half of it."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.exposure_factor *= std::exp2(p.stops);
}

}  // namespace

model::Effect Exposure() {
  return DefineEffect<Parameters>({
      .name = "exposure",
      .stage = model::Stage::kImageSensor,
      .meaning = "Aperture, shutter or lamp give more or less light than nominal.",
      .signature = "All grey levels are multiplied by the same factor; what exceeds white is lost.",
      .check_on_rig = "Photograph a grey card, and double the shutter time: levels must double.",
      .remedy = "Fix aperture, shutter and gain by hand; photograph a grey card before every session.",
      .confounded_with =
          {
              {"",
               "Put a card of known reflectance into the picture: a surface of another albedo changes the "
               "object and not the card."},
              {"gamma",
               "Photograph a wedge of grey steps: exposure multiplies all of them, a gamma bends the curve "
               "and leaves black and white where they are."},
              {"ambient_light",
               "Look at the dark sides: ambient light adds the same amount to all faces, exposure multiplies "
               "and leaves black black."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
