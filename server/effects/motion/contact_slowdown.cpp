// Contact slowdown: the first contact brakes the arm; from then on it moves more slowly.
//   speed after the first contact = (1 - fraction) * speed
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double fraction;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::fraction, "fraction", Unit::kNone, 0, 0.95, 0, 0.1,
     "Share of its speed that the arm loses at the first contact."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.slowdown_fraction = p.fraction;
}

}  // namespace

model::Effect ContactSlowdown() {
  return DefineEffect<Parameters>({
      .name = "contact_slowdown",
      .stage = model::Stage::kMotion,
      .meaning = "The first contact slows the arm down; the other fingers go on at a lower speed.",
      .signature =
          "Delays that grow in proportion to the gap to the first finger. object_push delays by the same "
          "amount however small the gap; speed_error and clock_skew stretch just the same and need an "
          "absolute clock to be distinguished.",
      .check_on_rig = "Log the arm's encoders during a touch: does the speed drop at the first contact?",
      .remedy = "Softer fingers or springs, a stiffer control mode, a lower speed; or keep the effect.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
