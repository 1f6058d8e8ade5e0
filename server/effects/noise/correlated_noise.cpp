// Correlated noise: noise with memory, a Gauss-Markov process in session time for each finger on its own.
//   t_i += sigma * x_i(session time),  x_i of variance 1, correlation exp(-pause / time) between touches
// The stage draws x_i (touch/gauss_markov.h): this file only says how large and how lasting it is. It adds to
// gaussian_noise, which has no memory.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double sigma_s;
  double time_s;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::sigma_s, "sigma_us", Unit::kMicrosecond, 0, 1e6, 0, 5000,
     "Standard deviation of one finger's correlated noise."},
    {&Parameters::time_s, "time_s", Unit::kSecond, 1e-3, 1e6, 300, 300,
     "How long it remembers: touches this far apart share 37 % of their error. Changes nothing at sigma_us "
     "0."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  if (p.sigma_s == 0) return;
  touches.wander_sigma_s = p.sigma_s;
  touches.wander_time_s = p.time_s;
}

}  // namespace

model::Effect CorrelatedNoise() {
  return DefineEffect<Parameters>({
      .name = "correlated_noise",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kNoiseMemory,
      .meaning = "Correlated noise (AR(1)) of each finger: touches made one after the other err alike.",
      .signature = "Repeats of a touch differ more the longer the pause between them; neighbours in time "
                   "agree. Unlike "
                   "thermal_drift the course has no direction and another session shows another one.",
      .check_on_rig =
          "Repeat one touch every ten seconds for an hour: the times drift instead of scattering.",
      .remedy = "Look for what drifts (temperature, supply, a loose part), or touch a reference plate now "
                "and then.",
      .confounded_with =
          {
              {"thermal_drift",
               "Repeat the session: a drift takes the same course again, correlated noise another one."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
