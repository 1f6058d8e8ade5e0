// Poses and rotations as vectors: a rotation vector points along the axis and is as long as the angle (rad).
#pragma once

#include <array>

#include <Eigen/Geometry>

namespace touchstone::geometry {

// Right-hand rule; exactly the identity for the vector 0.
Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& rotation_rad);
// Of a proper rotation; its length is from 0 to pi.
Eigen::Vector3d RotationVectorOf(const Eigen::Matrix3d& rotation);

// x, y, z (m), then the rotation vector (rad): as Universal Robots and the journal write a pose.
Eigen::Isometry3d PoseFromVector(const std::array<double, 6>& vector);
std::array<double, 6> PoseVectorOf(const Eigen::Isometry3d& pose);

}  // namespace touchstone::geometry
