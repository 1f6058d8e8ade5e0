#include "tests/rig/world/resting_face.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace touchstone::rig {

const std::vector<std::string>& FaceNames() {
  static const std::vector<std::string> names = {"+x", "-x", "+y", "-y", "+z", "-z"};
  return names;
}

Eigen::Isometry3d BaseFromPlacedObject(const Eigen::Isometry3d& base_from_object_at_plus_z,
                                       const Eigen::Vector3d& box_min_m, const Eigen::Vector3d& box_max_m,
                                       const std::string& up_face) {
  const auto& names = FaceNames();
  const auto found = std::find(names.begin(), names.end(), up_face);
  if (found == names.end())
    throw std::invalid_argument("no face is called '" + up_face + "'; there are +x, -x, +y, -y, +z, -z");
  const int axis = static_cast<int>(found - names.begin()) / 2;
  const double sign = (found - names.begin()) % 2 == 0 ? 1 : -1;

  // The face's outward normal goes to the object's z as it was; quarter turns, so whole numbers.
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (axis == 0)  // about y
    turn << 0, 0, -sign, 0, 1, 0, sign, 0, 0;
  else if (axis == 1)  // about x
    turn << 1, 0, 0, 0, 0, -sign, 0, sign, 0;
  else if (sign < 0)
    turn << 1, 0, 0, 0, -1, 0, 0, 0, -1;

  // Turned about its centre the box reaches half its size along `axis` down; before it was half its height.
  const Eigen::Vector3d centre = 0.5 * (box_min_m + box_max_m), half = 0.5 * (box_max_m - box_min_m);
  Eigen::Isometry3d upright_from_object = Eigen::Isometry3d::Identity();
  upright_from_object.linear() = turn;
  upright_from_object.translation() = centre - turn * centre;
  upright_from_object.translation().z() += half[axis] - half.z();
  return base_from_object_at_plus_z * upright_from_object;
}

}  // namespace touchstone::rig
