// How objects lie on the emulated fixture, written down a second time,
// independently of server/gateway/calibration.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

namespace touchstone::rig {

// The faces of an object's box that can be turned up: "+x", "-x", "+y", "-y", "+z" (as in the
// mesh file), "-z".
const std::vector<std::string>& FaceNames();

// base_from_object with that face up, from base_from_object at "+z": turned about the centre of the box by
// the least rotation (for "-z" by 180 deg about the object's x), and as high above the fixture as at "+z".
// Throws std::invalid_argument for another name.
Eigen::Isometry3d BaseFromPlacedObject(const Eigen::Isometry3d& base_from_object_at_plus_z,
                                       const Eigen::Vector3d& box_min_m, const Eigen::Vector3d& box_max_m,
                                       const std::string& up_face);

}  // namespace touchstone::rig
