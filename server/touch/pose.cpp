// Pose: commanded touch -> the real lines of the finger tips, in the frame of the nominal mesh.
#include "server/touch/simulate.h"

namespace touchstone::touch {

void PoseLines(const effects::TouchBatch& batch, TouchWorkspace* workspace) {
  const int size = batch.size();
  workspace->origins_m.resize(static_cast<size_t>(size) * batch.fingers());
  workspace->directions.resize(workspace->origins_m.size());
  const bool moved = batch.surface_scale != 1 || !batch.surface_rotation.isIdentity(0) ||
                     !batch.surface_translation_m.isZero(0);
  for (int finger = 0; finger < batch.fingers(); ++finger) {
    const double x_m = batch.FingerPosition(finger) * batch.spacing_m;
    Eigen::Vector3d* origins = &workspace->origins_m[batch.At(finger, 0)];
    Eigen::Vector3d* directions = &workspace->directions[batch.At(finger, 0)];
    for (int touch = 0; touch < size; ++touch) {
      origins[touch] = batch.target_m[touch] - batch.approach[touch] * batch.standoff_m[touch] +
                       batch.lateral[touch] * x_m + batch.tip_displacement_m;
      directions[touch] = batch.approach[touch];
    }
    if (!moved) continue;
    // surface = translation + rotation * (scale * mesh), so the line goes the other way into the mesh's
    // frame.
    const Eigen::Matrix3d mesh_from_object = batch.surface_rotation.transpose();
    for (int touch = 0; touch < size; ++touch) {
      origins[touch] =
          mesh_from_object * (origins[touch] - batch.surface_translation_m) / batch.surface_scale;
      directions[touch] = mesh_from_object * directions[touch];
    }
  }
}

}  // namespace touchstone::touch
