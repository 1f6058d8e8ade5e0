// Focal error: the lens magnifies more or less than the nominal one.
//   fx, fy = nominal * (1 + relative);  several multiply
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double relative;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::relative, "relative", Unit::kNone, -0.9, 9, 0, 0.01,
     "Relative error of the focal length; 0.01 makes the picture one per cent larger about the "
     "principal point."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.focal_factor *= 1 + p.relative;
}

}  // namespace

model::Effect FocalError() {
  return DefineEffect<Parameters>({
      .name = "focal_error",
      .stage = model::Stage::kProjection,
      .meaning = "The focal length differs from the nominal one: the picture is larger or smaller about the "
                 "principal point.",
      .signature =
          "Every object is larger or smaller in every picture by the same share, whatever its distance.",
      .check_on_rig =
          "Photograph a ruler at a known distance and count pixels, or calibrate with a chessboard.",
      .remedy = "Enter the calibrated focal length in camera.yaml; fix the zoom and focus rings.",
      .confounded_with =
          {
              {"camera_translation",
               "Photograph from two distances: a wrong focal length changes the size by the same share at "
               "both, a camera that stands nearer changes it more at the nearer."},
              {"object_scale",
               "Look at the object with another camera, or touch it: an object of another size is so for "
               "every instrument."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
