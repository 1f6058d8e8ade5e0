// Principal point: the optical axis meets the image sensor elsewhere than assumed.
//   cx, cy = nominal + offset;  several add up
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  Eigen::Vector2d offset_px;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::offset_px, "offset_px", Unit::kPixel, -1000, 1000, 0, 3,
     "How far the principal point lies from the nominal one: right, down."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.principal_point_offset_px += p.offset_px;
}

}  // namespace

model::Effect PrincipalPoint() {
  return DefineEffect<Parameters>({
      .name = "principal_point",
      .stage = model::Stage::kProjection,
      .meaning = "The optical axis meets the image sensor beside the assumed principal point.",
      .signature =
          "Every picture is shifted by the same number of pixels at every distance, without the slight "
          "stretching towards one side that a turned camera brings.",
      .check_on_rig = "Calibrate the lens with a chessboard that also fills the corners of the picture.",
      .remedy = "Enter the calibrated principal point in camera.yaml.",
      .confounded_with =
          {
              {"camera_rotation",
               "Turn the camera about its viewing axis by 180 deg and photograph the same point: the mean of "
               "the two places is the principal point. Wide-angle pictures with the object in the corners "
               "tell the two apart as well."},
              {"camera_translation",
               "Photograph from two distances: a shifted principal point moves both pictures by the same "
               "number of pixels."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
