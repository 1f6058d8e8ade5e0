// Gaussian noise: every finger's time has an independent normal error, before the minimum is subtracted.
//   t_i += sigma * z_i,  z_i standard normal; independent sources add in quadrature
// The stage draws z_i and multiplies: this file only says how large the noise is, so incidence_noise and
// heavy_tail_noise act on it wherever they stand in the stack.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double sigma_s;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::sigma_s, "sigma_us", Unit::kMicrosecond, 0, 1e6, 0, 5000,
     "Standard deviation of one finger's time; of the difference of two it is 1.41 times as much."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  if (p.sigma_s == 0) return;
  Eigen::Map<Eigen::ArrayXd> sigma_s(touches.noise_sigma_s.data(), touches.noise_sigma_s.size());
  if (touches.any_noise)
    sigma_s = (sigma_s * sigma_s + p.sigma_s * p.sigma_s).sqrt();
  else
    sigma_s = p.sigma_s;
  touches.any_noise = true;
}

}  // namespace

model::Effect GaussianNoise() {
  return DefineEffect<Parameters>({
      .name = "gaussian_noise",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kNoiseLevel,
      .meaning = "Each finger's time scatters independently, with a normal distribution.",
      .signature = "Repeats of the same touch differ, everywhere alike, and their mean settles with the "
                   "number of repeats. "
                   "It sets the noise floor: no model can go below it.",
      .check_on_rig = "Repeat one touch thirty times without moving anything else.",
      .remedy =
          "Better switches, slower approach, more repeats; its value is estimated anew by every diagnosis.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
