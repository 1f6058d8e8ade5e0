// Poll interval: the controller looks at its inputs in a loop, so a contact is seen at the loop's next tick.
//   times are rounded up to ticks of the interval; the loop's phase is random, one draw per touch (the stage's)
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double interval_s;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::interval_s, "interval_us", Unit::kMicrosecond, 0, 1e6, 0, 1000,
     "Time between two looks at the inputs; 0: every contact is seen at once."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.poll_interval_s = p.interval_s;
}

}  // namespace

model::Effect PollInterval() {
  return DefineEffect<Parameters>({
      .name = "poll_interval",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kQuantisation,
      .meaning = "Contacts are noticed only at the ticks of a polling loop.",
      .signature = "Time differences are multiples of the interval: a histogram of them is a comb; close "
                   "contacts come out as exactly equal.",
      .check_on_rig = "Plot a histogram of all time differences with narrow bins, or toggle a pin in the "
                      "loop and measure "
                      "it with an oscilloscope.",
      .remedy = "Use interrupts or input capture, or shorten the loop.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
