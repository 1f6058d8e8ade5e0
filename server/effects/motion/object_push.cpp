// Object push: the first finger that touches shifts a loosely held object along the approach.
//   d_j += shift   for every finger j but the first
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double shift_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::shift_m, "shift_mm", Unit::kMillimetre, 0, 50, 0, 0.3, "How far the object gives way.",
     /*sum_zero=*/false, /*reciprocal=*/false, /*usual=*/5},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    double* travel_m = touches.travel_m.data() + touches.At(finger, 0);
    for (int touch = 0; touch < touches.size(); ++touch)
      if (touches.first_finger[touch] != finger) travel_m[touch] += p.shift_m;
  }
}

}  // namespace

model::Effect ObjectPush() {
  return DefineEffect<Parameters>({
      .name = "object_push",
      .stage = model::Stage::kMotion,
      .meaning = "The first contact shifts the object; the other fingers have farther to go.",
      .signature = "A step: the same delay on every later finger, however small the gap. A slowdown grows "
                   "with the gap.",
      .check_on_rig = "Clamp the object and repeat ten touches: the step disappears.",
      .remedy = "Stiffen the fixture, or keep the effect in the model.",
      .confounded_with =
          {
              {"contact_slowdown",
               "Clamp the object: a push disappears. Or touch surfaces of larger steps: a slowdown grows"
               " with the gap."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
