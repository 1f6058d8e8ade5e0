// Clock skew: the clock that stamps the contacts runs fast or slow.
//   reported times are multiplied by (1 + relative)
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double relative;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::relative, "relative", Unit::kNone, -0.1, 0.1, 0, 0.001,
     "Relative excess of the clock; 0.001 gains one millisecond a second."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.clock_factor *= 1 + p.relative;
}

}  // namespace

model::Effect ClockSkew() {
  return DefineEffect<Parameters>({
      .name = "clock_skew",
      .stage = model::Stage::kSensor,
      .meaning =
          "The clock of the end effector runs fast or slow, so all times are stretched by a constant share.",
      .signature = "The error grows in proportion to the time difference. Relative times cannot tell it from "
                   "speed_error; crystals err by 1e-4, ceramic resonators by 5e-3, so "
                   "larger values point at the speed.",
      .check_on_rig = "Let the controller report its clock for ten minutes against the computer's.",
      .remedy = "Use a crystal, or synchronise the clock over the serial line.",
      .confounded_with =
          {
              {"contact_slowdown",
               "Compare with an absolute clock; or read the arm's speed before and after the first "
               "contact."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
