// Gravity sag: arm and fingers bend under their own weight, so the tips stand lower than commanded.
//   every tip is moved by drop along -z of the object frame, whatever the approach
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double drop_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::drop_m, "drop_mm", Unit::kMillimetre, 0, 20, 0, 0.5,
     "How much lower the finger tips stand."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.tip_displacement_m.z() -= p.drop_m;
}

}  // namespace

model::Effect GravitySag() {
  return DefineEffect<Parameters>({
      .name = "gravity_sag",
      .stage = model::Stage::kPose,
      .meaning = "The finger tips hang lower than commanded, along -z of the object frame.",
      .signature =
          "Shows on sloping or curved side faces touched horizontally, with one sign all around the object; "
          "approaches from straight above show nothing, since all fingers shift alike. An object that lies "
          "too high (object_pose, z) looks the same.",
      .check_on_rig =
          "Move a tip to a height gauge from the side, with the arm stretched and with it folded: a sag "
          "grows with the reach.",
      .remedy = "Set the payload and centre of gravity in the arm's installation, stiffen the "
                "fingers, or keep the effect.",
      .confounded_with =
          {
              {"object_pose",
               "Turn the object upside down: sag stays below, a misplaced object turns along."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
