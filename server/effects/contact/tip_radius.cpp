// Tip radius: the fingers end in spheres, not points. A sphere meets a sloping surface with its flank, before the
// point in front would, and rolls over edges and corners.
//   contact when the swept sphere first touches the surface; on a plane its foremost point has then gone
//   radius (1 / cos(inc) - 1) less than a point would. The stage casts the sphere (geometry/surface/surface.h).
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double radius_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::radius_m, "radius_mm", Unit::kMillimetre, 0, 20, 0, 1.5,
     "Radius of the ball at each finger's end."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.tip_radius_m = p.radius_m;
}

}  // namespace

model::Effect TipRadius() {
  return DefineEffect<Parameters>({
      .name = "tip_radius",
      .stage = model::Stage::kContact,
      .before_cast = true,
      .meaning = "The finger tips are spheres: contact is when the swept sphere first touches the surface.",
      .signature =
          "Contact comes early on slopes, by radius * (1 / cos(incidence) - 1): little below 10 deg, much "
          "above 30 deg, and early beside edges. oblique_slip comes late instead and follows tan(incidence).",
      .check_on_rig = "Measure the tips, or touch one flat face at 0 and 25 deg: only the second shifts.",
      .remedy = "Keep the measured radius in the model; pointed tips make it small.",
      .confounded_with =
          {
              {"oblique_slip",
               "Measure the tips, or touch one flat face at 0 and at 25 deg: balls come early there, "
               "slip comes late."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
