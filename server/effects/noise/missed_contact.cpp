// Missed contact: a finger touches and reports nothing.
//   each finger's report is lost with this probability, independently (the stage draws)
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double probability;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::probability, "probability", Unit::kNone, 0, 0.9, 0, 0.01,
     "How often a finger that touches reports nothing."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.missed_probability = p.probability;
}

}  // namespace

model::Effect MissedContact() {
  return DefineEffect<Parameters>({
      .name = "missed_contact",
      .stage = model::Stage::kSensor,
      .role = model::EffectRole::kDropout,
      .meaning = "Now and then a finger that touches reports nothing.",
      .signature =
          "Empty times at places where repeats of the same touch have one. Fingers that miss the object are "
          "empty in every repeat.",
      .check_on_rig = "Count empty times over a hundred touches of a large flat plate, for each finger.",
      .remedy = "Check switch travel, debouncing and cables of the finger that misses most.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
