// Incidence noise: on a slope the trigger scatters more.
//   sigma grows to sigma * (1 + slope * tan(inc_i))
// Needs gaussian_noise to have something to grow; the order of the two in the stack does not matter, since
// the factor is kept apart (TouchBatch::noise_growth). Beyond 89.94 deg the tangent is held (incidence.h).
#include "server/effects/define_effect.h"
#include "server/effects/sensor/incidence.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double slope;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::slope, "slope", Unit::kNone, 0, 20, 0, 1,
     "Relative growth of sigma at 45 deg of incidence; 1 doubles it there."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  if (p.slope == 0) return;
  if (touches.noise_growth.empty()) touches.noise_growth.assign(touches.cos_incidence.size(), 1.0);
  Eigen::Map<Eigen::ArrayXd> growth(touches.noise_growth.data(), touches.noise_growth.size());
  growth *= 1.0 + p.slope * TanIncidence(touches);
}

}  // namespace

model::Effect IncidenceNoise() {
  return DefineEffect<Parameters>({
      .name = "incidence_noise",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kNoiseGrowth,
      .meaning = "The scatter of a finger's time grows with the obliqueness of its contact.",
      .signature =
          "Repeats scatter more on slopes than head-on, while their means stay right; a model with constant "
          "noise is then too sure on slopes and not sure enough on flat faces.",
      .check_on_rig =
          "Thirty repeats of one touch head-on and thirty at 30 deg: compare the standard deviations.",
      .remedy = "Rough tips, or trust oblique touches less.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
