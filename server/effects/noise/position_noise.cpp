// Position noise: where along its travel a finger triggers scatters, by a length and not by a time.
//   d_i += sigma * z_i,  z_i standard normal; in time sigma * (time per travel), so it doubles at half the speed
// It adds to gaussian_noise in quadrature: the sensor stage draws once, from both.
#include <cmath>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double sigma_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::sigma_m, "sigma_mm", Unit::kMillimetre, 0, 20, 0, 0.1,
     "Standard deviation of the travel at which one finger triggers."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  if (p.sigma_m == 0) return;
  for (size_t e = 0; e < touches.noise_sigma_s.size(); ++e) {
    const double sigma_s = p.sigma_m * touches.time_per_travel_s_m[e];
    if (std::isfinite(sigma_s)) touches.noise_sigma_s[e] = std::hypot(touches.noise_sigma_s[e], sigma_s);
  }
  touches.any_noise = true;
}

}  // namespace

model::Effect PositionNoise() {
  return DefineEffect<Parameters>({
      .name = "position_noise",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kNoiseOfLength,
      .meaning = "Where each finger triggers scatters independently, by a length: slow touches scatter more "
                 "in time.",
      .signature =
          "Repeats of a touch at half the speed scatter twice as much in time and alike in millimetres. At "
          "one speed it looks like gaussian_noise; over several, taken for one kind of noise, like heavy "
          "tails.",
      .check_on_rig =
          "Repeat one touch thirty times at each of two speeds: compare the standard deviations in mm.",
      .remedy = "Stiffer tips or arm and better switches; touching faster hides it in the times, not in the "
                "lengths.",
      .confounded_with =
          {
              {"gaussian_noise",
               "Repeats at another speed: a noise of lengths changes in time, one of times does not."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
