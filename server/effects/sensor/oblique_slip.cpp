// Oblique slip: a finger that meets a slope slides along it before its switch triggers.
//   d_i += travel * tan(inc_i)
// It acts on the report alone (the other fingers and the object stay where they are), so the extra travel
// becomes time at the speed of the contact. Beyond 89.94 deg the tangent is held (incidence.h).
#include "server/effects/define_effect.h"
#include "server/effects/sensor/incidence.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double travel_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::travel_m, "travel_mm", Unit::kMillimetre, 0, 50, 0, 0.3,
     "Extra travel before the finger triggers, at 45 deg of incidence.",
     /*sum_zero=*/false, /*reciprocal=*/false, /*usual=*/5},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  using Array = Eigen::ArrayXd;
  Eigen::Map<Array> reported_s(touches.reported_time_s.data(), touches.reported_time_s.size());
  const Eigen::Map<const Array> inverse_speed_s_per_m(touches.time_per_travel_s_m.data(),
                                                      touches.time_per_travel_s_m.size());
  reported_s += p.travel_m * TanIncidence(touches) * inverse_speed_s_per_m;
}

}  // namespace

model::Effect ObliqueSlip() {
  return DefineEffect<Parameters>({
      .name = "oblique_slip",
      .stage = model::Stage::kSensor,
      .meaning = "On an oblique surface the finger slides before it triggers, so it reports late.",
      .signature =
          "Late by travel * tan(incidence): nothing head-on, visible from a few degrees on. tip_radius comes "
          "early instead and stays small below 10 deg.",
      .check_on_rig =
          "Touch one flat face at 0, 15 and 30 deg; then put rubber on the tips or grease on the face: slip "
          "changes with friction, geometry does not.",
      .remedy = "Rough or rubber tips, switches that trigger at less force, or keep the effect.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
