// How a surface that departs from its mesh enters a touch: the one place for surface_error and surface_map.
//   d_i -= h(contact_i) / cos(inc_i)
// First order: the departure moves the surface along its normal, and neither the normal nor the place of the contact
// on the surface is found anew. Beyond 84 deg the division is held at cos = 0.1.
#pragma once

#include <functional>

#include <Eigen/Core>

#include "server/effects/touch_batch.h"

namespace touchstone::effects {

inline constexpr double kMinDepartureCosine = 0.1;

// The place of a contact in the frame of the mesh, which moves and turns with the object.
inline Eigen::Vector3d ContactInMesh(const TouchBatch& touches, int entry) {
  const Eigen::Matrix3d mesh_from_object = touches.surface_rotation.transpose() / touches.surface_scale;
  return mesh_from_object * (touches.contact_m[entry] - touches.surface_translation_m);
}

// `departure_m`: of the surface at a place of the mesh, along the outward normal. Fingers without contact keep it so.
void MoveSurface(const std::function<double(const Eigen::Vector3d& point_in_mesh)>& departure_m,
                 TouchBatch& touches);

}  // namespace touchstone::effects
