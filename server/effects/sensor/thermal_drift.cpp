// Thermal drift: fingers and their electronics warm up, and each trigger point drifts through the session.
//   d_i += rate_i * session time,  sum of the rates 0
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  PerFinger rate_m_s;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::rate_m_s, "rate_mm_per_h", Unit::kMillimetrePerHour, -5, 5, 0, 0.1,
     "How fast each finger's trigger point recedes, first to last.", /*sum_zero=*/true},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    const double rate_m_s = p.rate_m_s[finger];
    const double* inverse_speed_s_per_m = touches.time_per_travel_s_m.data() + touches.At(finger, 0);
    double* reported_time_s = touches.reported_time_s.data() + touches.At(finger, 0);
    for (int touch = 0; touch < touches.size(); ++touch)
      reported_time_s[touch] += rate_m_s * touches.session_time_s[touch] * inverse_speed_s_per_m[touch];
  }
}

}  // namespace

model::Effect ThermalDrift() {
  return DefineEffect<Parameters>({
      .name = "thermal_drift",
      .stage = model::Stage::kSensor,
      .meaning = "The fingers' trigger points drift apart while the rig warms up.",
      .signature =
          "The error of each finger grows in a straight line with session_time_s and starts anew with every "
          "session; without session times it looks like too much noise.",
      .check_on_rig = "Repeat one touch every ten minutes for two hours after switching on.",
      .remedy = "Let the rig warm up first, or touch a reference plate every half hour and subtract it.",
      .confounded_with =
          {
              {"finger_length",
               "Pause for an hour with the rig warm and repeat ten touches: only a drift has gone on."},
              {"channel_latency",
               "Pause for an hour with the rig warm and repeat ten touches: only a drift has gone on."},
          },
      .rows = kRows,
      .needs = {.session_time = true},
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
