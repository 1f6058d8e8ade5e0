// Finger spacing: neighbouring fingers stand farther apart, or closer, than the rig's description says.
//   real spacing = nominal + delta
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double delta_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::delta_m, "delta_mm", Unit::kMillimetre, -10, 10, 0, 0.5,
     "Real minus nominal distance between neighbouring fingers."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.spacing_m += p.delta_m;
}

}  // namespace

model::Effect FingerSpacing() {
  return DefineEffect<Parameters>({
      .name = "finger_spacing",
      .stage = model::Stage::kPose,
      .meaning = "The real distance between neighbouring fingers differs from the nominal one.",
      .signature =
          "Grows with the slope and the curvature along the row of fingers: on a slope the outer fingers err "
          "with opposite signs, on a bulge both are late if they stand too wide. Flat "
          "faces met head-on show nothing.",
      .check_on_rig =
          "Measure the distance of the outer tips with calipers and divide by the number of gaps.",
      .remedy = "Write the measured spacing into end_effector.spacing_mm of the model.",
      .confounded_with =
          {
              {"object_scale", "Measure the distance of the outer fingers with a caliper."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
