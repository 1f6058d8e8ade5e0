// Contact: line x surface -> travel, point, normal, incidence, curvature.
#include <algorithm>
#include <cmath>

#include "server/touch/simulate.h"

namespace touchstone::touch {

void FindContacts(bool curvature, effects::TouchBatch* batch, TouchWorkspace* workspace) {
  const geometry::Surface& surface = *batch->surface;
  const double scale = batch->surface_scale;
  geometry::Contacts& contacts = workspace->contacts;
  const double longest_m = batch->stroke_m / scale;
  if (batch->tip_radius_m > 0) {
    surface.SweepSpheres(workspace->origins_m, workspace->directions, batch->tip_radius_m / scale, longest_m,
                         &contacts);
  } else {
    surface.CastLines(workspace->origins_m, workspace->directions, longest_m, &contacts);
  }

  const size_t count = workspace->origins_m.size();
  if (curvature) {
    for (size_t k = 0; k < count; ++k) {
      batch->curvature_per_m[k] =
          contacts.triangle[k] == geometry::kNoTriangle
              ? 0
              : surface.MeanCurvaturePerM(contacts.triangle[k], contacts.point_m[k]) / scale;
    }
  }

  // Back into the object frame. Without a moved surface the arrays change hands instead of being copied.
  const bool moved =
      scale != 1 || !batch->surface_rotation.isIdentity(0) || !batch->surface_translation_m.isZero(0);
  if (moved) {
    const Eigen::Matrix3d& rotation = batch->surface_rotation;
    for (size_t k = 0; k < count; ++k) {
      batch->normal[k] = rotation * contacts.normal[k];
      batch->contact_m[k] = batch->surface_translation_m + scale * (rotation * contacts.point_m[k]);
    }
  } else {
    batch->normal.swap(contacts.normal);
    batch->contact_m.swap(contacts.point_m);
  }

  for (int finger = 0; finger < batch->fingers(); ++finger) {
    for (int touch = 0; touch < batch->size(); ++touch) {
      const int k = batch->At(finger, touch);
      // The stroke ends the approach by the real travel, offsets included.
      const double travel_m = contacts.travel_m[k] * scale + batch->travel_offset_m[k];
      batch->travel_m[k] = travel_m <= batch->stroke_m ? travel_m : NAN;
      batch->cos_incidence[k] = std::clamp(-batch->approach[touch].dot(batch->normal[k]), 0.0, 1.0);
    }
  }
}

}  // namespace touchstone::touch
