// Speed error: the arm moves faster or slower than commanded.
//   real speed = commanded * (1 + relative)
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double relative;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::relative, "relative", Unit::kNone, -0.5, 0.5, 0, 0.02,
     "Relative excess of the real speed; 0.02 is two per cent too fast."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.speed_factor *= 1 + p.relative;
}

}  // namespace

model::Effect SpeedError() {
  return DefineEffect<Parameters>({
      .name = "speed_error",
      .stage = model::Stage::kMotion,
      .meaning = "The arm's real speed differs from the commanded one by a constant share.",
      .signature =
          "Every time difference is stretched or shrunk by the same share, so the error grows with the "
          "difference. Relative times cannot tell it from clock_skew "
          "(and contact_slowdown, which only stretches).",
      .check_on_rig = "Time 200 mm of travel with the arm's encoders, or film it against a ruler.",
      .remedy = "Correct the commanded speed, check the speed slider of the pendant, or keep the effect.",
      .confounded_with =
          {
              {"clock_skew",
               "Compare with an absolute clock, or with the arm's encoders: only a wrong speed shows "
               "there."},
              {"contact_slowdown",
               "Read the arm's speed from its encoders before and after the first contact, or clamp the "
               "object and touch with one finger: a slowdown begins at the first contact."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
