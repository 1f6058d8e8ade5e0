// Camera translation: the camera stands elsewhere than commanded.
//   centre = commanded centre + R * offset,  R: the commanded camera's axes (x right, y down, z forward)
// Several add up, and the offset is in the commanded axes however the camera is turned.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  Eigen::Vector3d offset_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::offset_m, "offset_mm", Unit::kMillimetre, -500, 500, 0, 2,
     "How far the camera stands off, in its own axes: right, down, forward."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.camera_offset_m += p.offset_m;
}

}  // namespace

model::Effect CameraTranslation() {
  return DefineEffect<Parameters>({
      .name = "camera_translation",
      .stage = model::Stage::kCameraPose,
      .meaning = "The camera stands displaced against its commanded pose, by the same vector of its own axes "
                 "in every picture.",
      .signature =
          "The object is shifted in every picture by the same number of pixels at one distance, less "
          "where it is farther away; nearer or farther shows as another size. A turn of the camera "
          "shifts near and far alike.",
      .check_on_rig =
          "Put a calibration board before the camera and compare the pose that it gives with the one "
          "that the arm reports (hand-eye calibration).",
      .remedy = "Repeat the hand-eye calibration with poses that are turned about all axes, and enter its "
                "result.",
      .confounded_with =
          {
              {"camera_rotation",
               "Photograph the object from two distances: a displaced camera shifts the near picture by more "
               "pixels, a turned one shifts both alike."},
              {"object_pose",
               "Turn the camera about its viewing axis by 90 deg: the error of the camera turns along, a "
               "misplaced object stays where it is."},
              {"object_scale",
               "Photograph from two distances, or measure the object with a caliper: a camera that stands "
               "nearer "
               "enlarges the near picture more, an object of another size enlarges both alike."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
