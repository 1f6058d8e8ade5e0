// Finger noise: some fingers scatter more than others.
//   t_i += sigma_i * z_i,  z_i standard normal
// It adds to gaussian_noise in quadrature, which is what all fingers have in common: a finger with 0 here is one of
// the quietest. The sensor stage draws once, from both.
#include <cmath>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  PerFinger sigma_s;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::sigma_s, "sigma_us", Unit::kMicrosecond, 0, 1e6, 0, 5000,
     "Standard deviation of what this finger's noise has beyond gaussian_noise; 0 for the quietest."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    if (p.sigma_s[finger] == 0) continue;
    for (int touch = 0; touch < touches.size(); ++touch) {
      double& sigma_s = touches.noise_sigma_s[touches.At(finger, touch)];
      sigma_s = std::hypot(sigma_s, p.sigma_s[finger]);
    }
    touches.any_noise = true;
  }
}

}  // namespace

model::Effect FingerNoise() {
  return DefineEffect<Parameters>({
      .name = "finger_noise",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kNoiseByFinger,
      .meaning =
          "Some fingers' times scatter more than others', each independently, with a normal distribution.",
      .signature = "Repeats differ more in the differences that involve one finger; the others agree among "
                   "themselves. Taken for one kind of noise it looks like slightly heavy tails.",
      .check_on_rig = "Repeat one touch thirty times and compare the scatter of l - m, m - r and l - r.",
      .remedy = "Look at that finger's switch, spring and cable; swap two fingers and see whether the noise "
                "goes along.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
