// Finger length: fingers are not equally long; a shorter one has farther to go.
//   d_i += offset_i,  sum of the offsets 0: a length that all fingers share cannot be seen in relative times
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  PerFinger offset_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::offset_m, "offset_mm", Unit::kMillimetre, -50, 50, 0, 0.2,
     "How much farther each finger travels, first to last; positive: the finger is short.",
     /*sum_zero=*/true, /*reciprocal=*/false, /*usual=*/5},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    const double offset_m = p.offset_m[finger];
    double* travel_offset_m = touches.travel_offset_m.data() + touches.At(finger, 0);
    for (int touch = 0; touch < touches.size(); ++touch) travel_offset_m[touch] += offset_m;
  }
}

}  // namespace

model::Effect FingerLength() {
  return DefineEffect<Parameters>({
      .name = "finger_length",
      .stage = model::Stage::kPose,
      .meaning = "The fingers differ in length, so each has its own constant distance to add.",
      .signature =
          "A constant distance per finger on every touch and object: times shift by offset / speed, so twice "
          "the speed halves the shift. channel_latency looks the same at one speed and "
          "does not change with it.",
      .check_on_rig =
          "Touch a flat plate square to the approach at two speeds; or lay the tips against a straight edge "
          "and use a feeler gauge.",
      .remedy = "Adjust the fingers' stops, or keep the measured offsets in the model.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
