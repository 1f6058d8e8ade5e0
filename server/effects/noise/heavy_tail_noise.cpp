// Heavy-tailed noise: now and then a time is far off, more often than a normal distribution allows.
//   Student-t deviates with these degrees of freedom instead of normal ones, times the sigma of
//   gaussian_noise
// sigma is then the scale of the distribution; its standard deviation is sigma * sqrt(nu / (nu - 2)) for nu
// > 2. The normal distribution is the limit of many degrees of freedom; files write the upper bound for it, and from
// there on the noise is exactly Gaussian. The order in the stack does not matter.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

constexpr double kGaussianDegrees = 1000;

struct Parameters {
  double degrees_of_freedom;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::degrees_of_freedom, "degrees_of_freedom", Unit::kNone, 1, kGaussianDegrees,
     kGaussianDegrees, 4, "Of Student's t; small: wild outliers, 1000 stands for Gaussian."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  if (p.degrees_of_freedom < kGaussianDegrees) touches.degrees_of_freedom = p.degrees_of_freedom;
}

}  // namespace

model::Effect HeavyTailNoise() {
  return DefineEffect<Parameters>({
      .name = "heavy_tail_noise",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kNoiseTails,
      .meaning = "The noise has outliers: Student's t instead of a normal distribution.",
      .signature = "Most repeats agree well and a few are far off; the standard deviation jumps from batch "
                   "to batch and "
                   "the quartiles do not.",
      .check_on_rig =
          "Repeat one touch a hundred times and plot the times against normal quantiles: the ends bend away.",
      .remedy = "Look for bouncing switches and loose plugs; use medians over repeats.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
