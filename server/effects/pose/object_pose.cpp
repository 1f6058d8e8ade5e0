// Object pose: the object lies elsewhere, or turned, compared with the frame in which touches are commanded.
//   surface = translation + R(rotation) * mesh: rotated about the mesh origin, then moved
// The rotation vector points along the axis; its length is the angle (right-hand rule).
#include "server/effects/define_effect.h"
#include "server/geometry/pose.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  Eigen::Vector3d translation_m;
  Eigen::Vector3d rotation_rad;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::translation_m, "translation_mm", Unit::kMillimetre, -100, 100, 0, 1,
     "How far the object has moved: x, y, z of the object frame."},
    {&Parameters::rotation_rad, "rotation_deg", Unit::kDegree, -180, 180, 0, 1,
     "How far the object has turned about the mesh origin: rotation vector x, y, z."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  const Eigen::Matrix3d rotation = geometry::RotationFromVector(p.rotation_rad);
  // On top of what the surface has gone through already.
  touches.surface_rotation = rotation * touches.surface_rotation;
  touches.surface_translation_m = rotation * touches.surface_translation_m + p.translation_m;
}

}  // namespace

model::Effect ObjectPose() {
  return DefineEffect<Parameters>({
      .name = "object_pose",
      .stage = model::Stage::kPose,
      .often_per_object = true,
      .moves_surface = true,
      .meaning = "The object lies moved or turned against the frame that the touches are commanded in.",
      .signature =
          "A turn tilts every flat face: outer fingers err with opposite signs, and the sign follows the "
          "face. A move shows at edges and on curved faces only. Another error for every object, and after "
          "every time the object was put down anew: then declare scope: object.",
      .check_on_rig =
          "Probe three flat faces of the object with one finger and compare with the mesh; or put the object "
          "down anew and see whether the error changes.",
      .remedy = "Probe and correct the object frame before a session, or use a fixture with three stops.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
