// Radial distortion, as OpenCV's: in normalised coordinates x = X / Z, y = Y / Z, r^2 = x^2 + y^2
//   x_d = x (1 + k1 r^2 + k2 r^4 + ...),  y_d alike
// k1 and k2 are added to those of the nominal lens; several add up.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double k1;
  double k2;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::k1, "k1", Unit::kNone, -2, 2, 0, 0.05,
     "Coefficient of r^2; negative: barrel, the corners are drawn inwards."},
    {&Parameters::k2, "k2", Unit::kNone, -5, 5, 0, 0.05, "Coefficient of r^4."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.k1 += p.k1;
  photo.k2 += p.k2;
}

}  // namespace

model::Effect RadialDistortion() {
  return DefineEffect<Parameters>({
      .name = "radial_distortion",
      .stage = model::Stage::kProjection,
      .meaning = "The lens bends straight lines: the magnification changes with the distance from the "
                 "principal point.",
      .signature =
          "Edges are displaced along the radius, by an amount that grows with the third power of the "
          "distance from the principal point; nothing shows in the middle.",
      .check_on_rig = "Photograph a straight edge along the border of the picture and lay a ruler on it.",
      .remedy = "Calibrate with a chessboard and enter the coefficients in camera.yaml.",
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
