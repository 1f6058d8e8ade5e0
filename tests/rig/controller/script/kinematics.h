// Forward and inverse kinematics of the emulated arm. SI, base frame, radians. Independent of the gateway's.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

namespace touchstone::rig {

using Joints = Eigen::Matrix<double, 6, 1>;
using Vector6 =
    Eigen::Matrix<double, 6, 1>;  // a pose as URScript writes it (x, y, z, rotation vector), or a twist

// Denavit-Hartenberg rows as the controller publishes them: T = RotZ(theta) TransZ(d) TransX(a) RotX(alpha).
struct ArmGeometry {
  std::array<double, 6> a_m{}, d_m{}, alpha_rad{}, theta_rad{};  // theta: added to the joint's angle
  std::array<double, 6> max_angle_rad{};                         // |q|; infinite for wrist 3
  std::array<double, 6> max_speed_rad_s{};
};

// "ur3" or "ur3e" without a calibration delta. Throws std::runtime_error for another name.
ArmGeometry GeometryOf(const std::string& model);

// The same arm with deltas as a factory's calibration leaves them: up to 1 mm and 2 mrad; those of d along the parallel
// axes 2 and 3 are large and cancel each other.
ArmGeometry CalibratedGeometry(ArmGeometry arm);

Eigen::Isometry3d BaseFromFlange(const ArmGeometry& arm, const Joints& joints);
// Columns: linear (3), angular (3) velocity of the flange's origin per joint speed, base frame.
Eigen::Matrix<double, 6, 6> Jacobian(const ArmGeometry& arm, const Joints& joints);

// Newton's method from `near`; none if it does not come within 1e-9 (m, rad) of the pose. Joint limits are
// not looked at.
std::optional<Joints> FollowTo(const ArmGeometry& arm, const Eigen::Isometry3d& base_from_flange,
                               const Joints& near);
// Every branch (up to 8) that reaches the pose within the joint limits, each joint turned to lie closest to
// `near`; the closest branch first. Empty: out of reach.
std::vector<Joints> AllInverse(const ArmGeometry& arm, const Eigen::Isometry3d& base_from_flange,
                               const Joints& near);

// p[x, y, z, rx, ry, rz] and back.
Eigen::Isometry3d FromPose(const Vector6& pose);
Vector6 ToPose(const Eigen::Isometry3d& transform);
Eigen::Vector3d RotationVector(const Eigen::Matrix3d& rotation);

}  // namespace touchstone::rig
