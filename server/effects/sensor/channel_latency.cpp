// Channel latency: the electronics of each finger take their own time to report.
//   t_i += latency_i,  sum of the latencies 0: what all channels share cannot be seen in relative times
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  PerFinger latency_s;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::latency_s, "latency_us", Unit::kMicrosecond, -1e6, 1e6, 0, 2000,
     "How much later each finger's channel reports, first to last.",
     /*sum_zero=*/true, /*reciprocal=*/false, /*usual=*/50000},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    const double latency_s = p.latency_s[finger];
    double* reported_time_s = touches.reported_time_s.data() + touches.At(finger, 0);
    for (int touch = 0; touch < touches.size(); ++touch) reported_time_s[touch] += latency_s;
  }
}

}  // namespace

model::Effect ChannelLatency() {
  return DefineEffect<Parameters>({
      .name = "channel_latency",
      .stage = model::Stage::kSensor,
      .meaning = "Each finger's switch, wiring and input report with a delay of their own.",
      .signature = "A constant time per finger on every touch, the same at every speed. finger_length looks "
                   "the same at "
                   "one speed and shrinks when the arm goes faster.",
      .check_on_rig =
          "Touch a flat plate at two speeds; or trigger all inputs from one signal and compare the times.",
      .remedy = "Match filters and debouncing of the channels, or keep the measured latencies.",
      .confounded_with =
          {
              {"finger_length",
               "Touch again at half and at twice the speed: a latency keeps its time, a length keeps its"
               " travel."},
              {"tool_tilt",
               "Touch again at half and at twice the speed: a latency keeps its time, a tilt keeps its "
               "travel."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
