// Gamma: the recorded grey level is a power of the light.
//   recorded = light^exponent, light from 0 to 1;  exponents of several multiply
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double exponent;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::exponent, "exponent", Unit::kNone, 0.1, 10, 1, 0.2,
     "Exponent of the response; 1: linear, 0.45: as most cameras record."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.gamma *= p.exponent;
}

}  // namespace

model::Effect Gamma() {
  return DefineEffect<Parameters>({
      .name = "gamma",
      .stage = model::Stage::kImageSensor,
      .meaning = "The camera records a power of the light.",
      .signature = "Middle greys are too bright (below 1) or too dark (above 1); black and white stay.",
      .check_on_rig = "Double the shutter time: levels that do not double show the exponent.",
      .remedy = "Switch the gamma of the camera off, or keep the effect.",
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
