// Return hysteresis: a finger that was pressed in has not fully come back when the next touch starts.
//   d_i -= fraction * c_i,  c_i = (last contact time - t_i) * speed of the session's previous touch
// A finger that stands a little too far in has less of its own way to go before its switch trips.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double fraction;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::fraction, "fraction", Unit::kNone, 0, 1, 0, 0.1,
     "Share of the previous touch's press that is still there."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  using Array = Eigen::ArrayXd;
  Eigen::Map<Array> reported_s(touches.reported_time_s.data(), touches.reported_time_s.size());
  const Eigen::Map<const Array> inverse_speed_s_per_m(touches.time_per_travel_s_m.data(),
                                                      touches.time_per_travel_s_m.size());
  const Eigen::Map<const Array> press_m(touches.previous_press_m.data(), touches.previous_press_m.size());
  reported_s -= p.fraction * press_m * inverse_speed_s_per_m;
}

}  // namespace

model::Effect ReturnHysteresis() {
  return DefineEffect<Parameters>({
      .name = "return_hysteresis",
      .stage = model::Stage::kSensor,
      .meaning = "A finger that was pressed far in by the previous touch has not fully sprung back and "
                 "reports early.",
      .signature =
          "The error follows the touch before, not this one: the finger that touched first then (and was "
          "pressed longest) reports early now. Shuffling the order of the touches moves the error along.",
      .check_on_rig = "Press one finger by hand, then touch a flat plate at once and again after a minute.",
      .remedy = "Stronger return springs, grease, a pause between touches; or keep the "
                "effect and the order of touches.",
      .confounded_with =
          {
              {"",
               "Repeat one touch after a deep and after a shallow one: only hysteresis remembers which "
               "came before."},
          },
      .rows = kRows,
      .needs = {.previous_press = true},
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
