#include "server/geometry/pose.h"

namespace touchstone::geometry {

Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& rotation_rad) {
  const double angle_rad = rotation_rad.norm();
  if (!(angle_rad > 0)) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, rotation_rad / angle_rad).toRotationMatrix();
}

Eigen::Vector3d RotationVectorOf(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Eigen::Isometry3d PoseFromVector(const std::array<double, 6>& vector) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() << vector[0], vector[1], vector[2];
  pose.linear() = RotationFromVector({vector[3], vector[4], vector[5]});
  return pose;
}

std::array<double, 6> PoseVectorOf(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d p = pose.translation(), r = RotationVectorOf(pose.linear());
  return {p.x(), p.y(), p.z(), r.x(), r.y(), r.z()};
}

}  // namespace touchstone::geometry
