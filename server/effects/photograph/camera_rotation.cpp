// Camera rotation: the camera is turned about its centre.
//   commanded_camera_from_real_camera = R(rotation),  rotation vector in the camera's axes (right-hand rule)
// Several act one after the other, each in the axes that the ones before have turned.
#include "server/effects/define_effect.h"
#include "server/geometry/pose.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  Eigen::Vector3d rotation_rad;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::rotation_rad, "rotation_deg", Unit::kDegree, -180, 180, 0, 0.5,
     "How far the camera is turned: rotation vector in its axes right, down, forward."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.camera_rotation *= geometry::RotationFromVector(p.rotation_rad);
}

}  // namespace

model::Effect CameraRotation() {
  return DefineEffect<Parameters>({
      .name = "camera_rotation",
      .stage = model::Stage::kCameraPose,
      .meaning = "The camera is turned about its centre against its commanded pose, alike in every picture.",
      .signature = "The whole picture is shifted (about right and down) or turned about its middle (about "
                   "forward), by the same pixels at every distance.",
      .check_on_rig =
          "Photograph one point from near and far along the viewing axis: with a turned camera it "
          "leaves the middle of the picture by the same angle.",
      .remedy = "Repeat the hand-eye calibration, or keep the effect.",
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
