// Tool tilt: the row of finger tips is not square to the approach, so one side leads and the other lags.
//   d_i += x_i tan(angle)
// x_i is taken with the spacing that the effects above in the stack have left (finger_spacing changes it).
#include <cmath>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double angle_rad;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::angle_rad, "angle_deg", Unit::kDegree, -30, 30, 0, 1,
     "The angle between the row of finger tips and the plane square to the "
     "approach; positive: the last finger lags."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  const double slope = std::tan(p.angle_rad);
  for (int finger = 0; finger < touches.fingers(); ++finger) {
    const double offset_m = touches.FingerPosition(finger) * touches.spacing_m * slope;
    double* travel_offset_m = touches.travel_offset_m.data() + touches.At(finger, 0);
    for (int touch = 0; touch < touches.size(); ++touch) travel_offset_m[touch] += offset_m;
  }
}

}  // namespace

model::Effect ToolTilt() {
  return DefineEffect<Parameters>({
      .name = "tool_tilt",
      .stage = model::Stage::kPose,
      .meaning = "The row of finger tips is not square to the approach: one outer finger "
                 "arrives early, the other equally late.",
      .signature =
          "The same straight line over the fingers on every touch, whatever the object: first finger early, "
          "last late (or the reverse), middle unchanged. finger_length also moves the middle finger.",
      .check_on_rig =
          "Touch a flat plate that is square to the approach; then turn the wrist by 180 deg and touch it "
          "again. A tilt of the tool turns with it, a tilt of the plate does not.",
      .remedy = "Shim the tool flange, or correct the tool frame of the arm by this angle.",
      .confounded_with =
          {
              {"finger_length", "Swap the outer fingers: lengths go with them, a tilt stays."},
              {"object_pose", "Turn the object by 90 deg about the approach: a tilt stays with the tool."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
