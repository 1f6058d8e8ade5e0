// Image noise: every pixel scatters on its own.
//   recorded grey += normal deviate of variance sigma^2 + gain * grey, then rounded to 8 bits
// Sigmas of several add in quadrature, gains add up.
#include <cmath>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double sigma_grey;
  double gain;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::sigma_grey, "sigma_grey", Unit::kGreyLevel, 0, 100, 0, 2,
     "Standard deviation in the dark, in grey levels (read-out)."},
    {&Parameters::gain, "gain", Unit::kNone, 0, 20, 0, 0.03,
     "Growth of the variance with the grey level (photons), in grey levels."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.noise_sigma_grey = std::hypot(photo.noise_sigma_grey, p.sigma_grey);
  photo.noise_gain += p.gain;
}

}  // namespace

model::Effect ImageNoise() {
  return DefineEffect<Parameters>({
      .name = "image_noise",
      .stage = model::Stage::kImageSensor,
      .role = model::EffectRole::kPixelNoise,
      .meaning = "The pixels of repeated photographs scatter independently.",
      .signature =
          "Repeats of one picture differ in every pixel, more in bright ones if there is a gain; their "
          "mean settles. It sets the noise floor: no model can go below it.",
      .check_on_rig = "Take thirty pictures of one scene without moving anything.",
      .remedy = "More light, longer exposure, lower gain of the camera, mean of several pictures.",
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
