#include "tests/rig/controller/script/kinematics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace touchstone::rig {
namespace {

constexpr double kPi = 3.14159265358979323846;

Eigen::Isometry3d Link(const ArmGeometry& arm, int i, double angle_rad) {
  Eigen::Isometry3d link = Eigen::Isometry3d::Identity();
  link.linear() = (Eigen::AngleAxisd(angle_rad + arm.theta_rad[i], Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(arm.alpha_rad[i], Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  const double angle = angle_rad + arm.theta_rad[i];
  link.translation() << arm.a_m[i] * std::cos(angle), arm.a_m[i] * std::sin(angle), arm.d_m[i];
  return link;
}

double Nearest(double angle_rad, double near_rad) {
  return angle_rad + 2 * kPi * std::round((near_rad - angle_rad) / (2 * kPi));
}

bool WithinLimits(const ArmGeometry& arm, const Joints& joints) {
  for (int i = 0; i < 6; ++i)
    if (std::abs(joints[i]) > arm.max_angle_rad[i] + 1e-9) return false;
  return true;
}

}  // namespace

ArmGeometry GeometryOf(const std::string& model) {
  ArmGeometry arm;
  if (model == "ur3") {
    arm.d_m = {.1519, 0, 0, .11235, .08535, .0819};
    arm.a_m = {0, -.24365, -.21325, 0, 0, 0};
  } else if (model == "ur3e") {
    arm.d_m = {.15185, 0, 0, .13105, .08535, .0921};
    arm.a_m = {0, -.24355, -.2132, 0, 0, 0};
  } else {
    throw std::runtime_error("no arm is named '" + model + "'; there are: ur3, ur3e");
  }
  arm.alpha_rad = {kPi / 2, 0, 0, kPi / 2, -kPi / 2, 0};
  arm.max_angle_rad.fill(2 * kPi);
  arm.max_angle_rad[5] = std::numeric_limits<double>::infinity();
  arm.max_speed_rad_s = {kPi, kPi, kPi, 2 * kPi, 2 * kPi, 2 * kPi};
  return arm;
}

ArmGeometry CalibratedGeometry(ArmGeometry arm) {
  const std::array<double, 6> a{2e-4, 8e-4, -6e-4, 1e-4, -1e-4, 0}, d{3e-4, 0.7, -0.7, 2e-4, 4e-4, -2e-4},
      alpha{1e-3, 0, 0, -8e-4, 6e-4, 0}, theta{0, 1.5e-3, -2e-3, 7e-4, 1e-3, -5e-4};
  for (int i = 0; i < 6; ++i) {
    arm.a_m[i] += a[i];
    arm.d_m[i] += d[i];
    arm.alpha_rad[i] += alpha[i];
    arm.theta_rad[i] += theta[i];
  }
  return arm;
}

Eigen::Isometry3d BaseFromFlange(const ArmGeometry& arm, const Joints& joints) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 6; ++i) pose = pose * Link(arm, i, joints[i]);
  return pose;
}

Eigen::Matrix<double, 6, 6> Jacobian(const ArmGeometry& arm, const Joints& joints) {
  std::array<Eigen::Vector3d, 6> axis, origin;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 6; ++i) {
    axis[i] = pose.linear().col(2);
    origin[i] = pose.translation();
    pose = pose * Link(arm, i, joints[i]);
  }
  Eigen::Matrix<double, 6, 6> jacobian;
  for (int i = 0; i < 6; ++i) {
    jacobian.block<3, 1>(0, i) = axis[i].cross(pose.translation() - origin[i]);
    jacobian.block<3, 1>(3, i) = axis[i];
  }
  return jacobian;
}

std::optional<Joints> FollowTo(const ArmGeometry& arm, const Eigen::Isometry3d& base_from_flange,
                               const Joints& near) {
  constexpr int kMaxSteps = 40;
  constexpr double kDamping = 1e-9, kWithin = 1e-9, kMaxTurn = 0.5;
  Joints joints = near;
  for (int step = 0; step < kMaxSteps; ++step) {
    const Eigen::Isometry3d pose = BaseFromFlange(arm, joints);
    Vector6 error;
    error.head<3>() = base_from_flange.translation() - pose.translation();
    error.tail<3>() = RotationVector(base_from_flange.linear() * pose.linear().transpose());
    if (error.lpNorm<Eigen::Infinity>() < kWithin) return joints;
    const Eigen::Matrix<double, 6, 6> jacobian = Jacobian(arm, joints);
    Eigen::Matrix<double, 6, 6> squared = jacobian * jacobian.transpose();
    squared.diagonal().array() += kDamping;
    Joints turn = jacobian.transpose() * squared.ldlt().solve(error);
    const double most = turn.lpNorm<Eigen::Infinity>();
    if (!std::isfinite(most)) return std::nullopt;
    if (most > kMaxTurn) turn *= kMaxTurn / most;
    joints += turn;
  }
  return std::nullopt;
}

std::vector<Joints> AllInverse(const ArmGeometry& arm, const Eigen::Isometry3d& base_from_flange,
                               const Joints& near) {
  std::vector<Joints> found;
  const Eigen::Vector3d flange = base_from_flange.translation();
  const Eigen::Vector3d wrist = base_from_flange * Eigen::Vector3d(0, 0, -arm.d_m[5]);
  const double across = std::hypot(wrist.x(), wrist.y());
  if (across < std::abs(arm.d_m[3])) return found;
  const Eigen::Matrix3d flange_from_base = base_from_flange.linear().transpose();
  // Closed form of the nominal arm: shoulder left or right, wrist up or down, elbow up or down. Newton's
  // method then carries each branch over to the individual arm.
  for (const double shoulder : {1.0, -1.0}) {
    const double q1 = std::atan2(wrist.y(), wrist.x()) + shoulder * std::acos(arm.d_m[3] / across) + kPi / 2;
    const double s1 = std::sin(q1), c1 = std::cos(q1);
    const double cos5 = (flange.x() * s1 - flange.y() * c1 - arm.d_m[3]) / arm.d_m[5];
    if (std::abs(cos5) > 1 + 1e-9) continue;
    for (const double bend : {1.0, -1.0}) {
      const double q5 = bend * std::acos(std::clamp(cos5, -1.0, 1.0));
      const double s5 = std::sin(q5);
      double q6 = near[5];
      if (std::abs(s5) > 1e-9) {
        q6 = std::atan2((-flange_from_base(1, 0) * s1 + flange_from_base(1, 1) * c1) / s5,
                        (flange_from_base(0, 0) * s1 - flange_from_base(0, 1) * c1) / s5);
      }
      const Eigen::Isometry3d fourth =
          Link(arm, 0, q1).inverse() * base_from_flange * (Link(arm, 4, q5) * Link(arm, 5, q6)).inverse();
      const Eigen::Vector3d third = fourth * Eigen::Vector3d(0, -arm.d_m[3], 0);
      const double reach = third.head<2>().norm();
      const double a2 = arm.a_m[1], a3 = arm.a_m[2];
      const double cos3 = (reach * reach - a2 * a2 - a3 * a3) / (2 * a2 * a3);
      if (std::abs(cos3) > 1 + 1e-9) continue;
      for (const double elbow : {1.0, -1.0}) {
        const double q3 = elbow * std::acos(std::clamp(cos3, -1.0, 1.0));
        // The two links as one complex number: third = e^{i q2} (a2 + a3 e^{i q3}).
        const double q2 =
            std::atan2(third.y(), third.x()) - std::atan2(a3 * std::sin(q3), a2 + a3 * std::cos(q3));
        const Eigen::Isometry3d last = (Link(arm, 1, q2) * Link(arm, 2, q3)).inverse() * fourth;
        const double q4 = std::atan2(last.linear()(1, 0), last.linear()(0, 0));
        Joints guess;
        guess << q1, q2, q3, q4, q5, q6;
        std::optional<Joints> exact = FollowTo(arm, base_from_flange, guess);
        if (!exact) continue;
        for (int i = 0; i < 6; ++i) {
          double& angle = (*exact)[i];
          angle = Nearest(angle, near[i]);
          while (angle > arm.max_angle_rad[i]) angle -= 2 * kPi;
          while (angle < -arm.max_angle_rad[i]) angle += 2 * kPi;
        }
        if (!WithinLimits(arm, *exact)) continue;
        bool twice = false;
        for (const Joints& other : found) twice |= (other - *exact).lpNorm<Eigen::Infinity>() < 1e-6;
        if (!twice) found.push_back(*exact);
      }
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [&](const Joints& x, const Joints& y) { return (x - near).norm() < (y - near).norm(); });
  return found;
}

Eigen::Isometry3d FromPose(const Vector6& pose) {
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  transform.translation() = pose.head<3>();
  const double angle = pose.tail<3>().norm();
  if (angle > 0) transform.linear() = Eigen::AngleAxisd(angle, pose.tail<3>() / angle).toRotationMatrix();
  return transform;
}

Eigen::Vector3d RotationVector(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn{Eigen::Quaterniond(rotation).normalized()};
  return turn.angle() * turn.axis();
}

Vector6 ToPose(const Eigen::Isometry3d& transform) {
  Vector6 pose;
  pose << transform.translation(), RotationVector(transform.linear());
  return pose;
}

}  // namespace touchstone::rig
