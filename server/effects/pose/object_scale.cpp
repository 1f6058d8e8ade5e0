// Object scale: the object is larger or smaller than its mesh in all directions.
//   surface = (1 + relative) * mesh, about the mesh origin
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double relative;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::relative, "relative", Unit::kNone, -0.2, 0.2, 0, 0.005,
     "Relative growth of all lengths; 0.01 is one per cent larger."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  touches.surface_scale *= 1 + p.relative;
}

}  // namespace

model::Effect ObjectScale() {
  return DefineEffect<Parameters>({
      .name = "object_scale",
      .stage = model::Stage::kPose,
      .often_per_object = true,
      .moves_surface = true,
      .meaning = "The object is larger or smaller than its mesh by the same share in every "
                 "direction (a print that shrank).",
      .signature =
          "Curved places look flatter (larger) or rounder (smaller), and edges stand farther out or in; flat "
          "faces met head-on show nothing, because all fingers meet them alike.",
      .check_on_rig = "Measure the object's length, width and height with calipers and divide by the mesh's.",
      .remedy = "Import the mesh with the measured scale, or print again with the shrinkage compensated.",
      .confounded_with =
          {
              {"speed_error",
               "Measure the object with a caliper, or touch it from the side with a shorter standoff: a "
               "wrong scale moves the surface, a wrong speed stretches all differences alike."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
