#include "server/gateway/arm/kinematics/kinematics.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kSingular = 1e-9;
constexpr double kOtherArmM = 0.05;

Eigen::Isometry3d Link(const DhRow& row, double joint_rad) {
  const double c = std::cos(joint_rad + row.theta_rad), s = std::sin(joint_rad + row.theta_rad);
  const double ca = std::cos(row.alpha_rad), sa = std::sin(row.alpha_rad);
  Eigen::Isometry3d link = Eigen::Isometry3d::Identity();
  link.linear() << c, -s * ca, s * sa, s, c * ca, -c * sa, 0, sa, ca;
  link.translation() << row.a_m * c, row.a_m * s, row.d_m;
  return link;
}

Eigen::Isometry3d Chain(const DhTable& table, const Joints& joints) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (size_t i = 0; i < 6; ++i) pose = pose * Link(table[i], joints[i]);
  return pose;
}

// The angle plus whole turns, nearest to another.
double Near(double angle_rad, double near_rad) {
  return near_rad + std::remainder(angle_rad - near_rad, 2 * kPi);
}

// acos that forgives rounding; NaN beyond.
double Acos(double cosine) {
  return std::abs(cosine) > 1 && std::abs(cosine) < 1 + 1e-9 ? (cosine > 0 ? 0 : kPi) : std::acos(cosine);
}

// The farthest that two tables put the flange apart at some joints far from each other.
double FlangesApart(const DhTable& a, const DhTable& b) {
  double apart_m = 0;
  for (const Joints& joints : {Joints{{0, -1.5, -1.5, -1.5, 1.5, 0}}, Joints{{2, -0.7, 0.9, 0.3, -1, 2}}}) {
    const double m = (Chain(a, joints).translation() - Chain(b, joints).translation()).norm();
    apart_m = std::isfinite(m) ? std::max(apart_m, m) : std::numeric_limits<double>::infinity();
  }
  return apart_m;
}

}  // namespace

double Farthest(const Joints& a, const Joints& b) {
  double farthest_rad = 0;
  for (size_t i = 0; i < 6; ++i) farthest_rad = std::max(farthest_rad, std::abs(a[i] - b[i]));
  return farthest_rad;
}

absl::StatusOr<UrKinematics> UrKinematics::ForModel(const std::string& model) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmModel* found, FindArmModel(model));
  return UrKinematics(found);
}

absl::StatusOr<UrKinematics> UrKinematics::Calibrated(const DhTable& table) const {
  const double apart_m = FlangesApart(table, nominal_);
  if (!(apart_m < kOtherArmM))
    return absl::FailedPreconditionError(
        absl::StrCat("the controller's calibrated kinematics lead the flange ", ShortestNumber(apart_m),
                     " m from where a ", model_->name, "'s do, at most ", kOtherArmM,
                     " m: is the arm's model set right?"));
  for (const ArmModel& other : ArmModels()) {
    if (const double m = FlangesApart(table, other.dh); m < apart_m)
      return absl::FailedPreconditionError(absl::StrFormat(
          "the controller's calibrated kinematics belong to a %s, from which they lead the flange %.1f mm "
          "away, not to a "
          "%s, from which it is %.1f mm: set arm.model right",
          other.name, m / kMetresPerMillimetre, model_->name, apart_m / kMetresPerMillimetre));
  }
  UrKinematics made = *this;
  made.table_ = table;
  made.calibrated_ = true;
  return made;
}

Eigen::Isometry3d UrKinematics::Forward(const Joints& joints) const {
  return Chain(table_, joints);
}

std::vector<Joints> UrKinematics::Inverse(const Eigen::Isometry3d& base_from_flange,
                                          const Joints& near) const {
  std::vector<Joints> solutions;
  for (Joints solution : NominalInverse(base_from_flange, near)) {
    if (calibrated_ && !Refine(base_from_flange, &solution)) continue;
    for (size_t i = 0; i < 6; ++i) solution[i] = Near(solution[i], near[i]);
    solutions.push_back(solution);
  }
  std::stable_sort(solutions.begin(), solutions.end(),
                   [&](const Joints& a, const Joints& b) { return Farthest(a, near) < Farthest(b, near); });
  return solutions;
}

std::optional<Joints> UrKinematics::Nearest(const Eigen::Isometry3d& base_from_flange,
                                            const Joints& near) const {
  for (Joints solution : NominalInverse(base_from_flange, near)) {
    if (calibrated_ && !Refine(base_from_flange, &solution)) continue;
    for (size_t i = 0; i < 6; ++i) solution[i] = Near(solution[i], near[i]);
    return solution;
  }
  return std::nullopt;
}

std::array<Eigen::Vector3d, 7> UrKinematics::LinkPoints(const Joints& joints) const {
  std::array<Eigen::Vector3d, 7> points;
  points[0].setZero();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (size_t i = 0; i < 6; ++i) {
    pose = pose * Link(nominal_[i], joints[i]);
    points[i + 1] = pose.translation();
  }
  return points;
}

std::vector<Joints> UrKinematics::NominalInverse(const Eigen::Isometry3d& base_from_flange,
                                                 const Joints& near) const {
  const double a2 = nominal_[1].a_m, a3 = nominal_[2].a_m, d4 = nominal_[3].d_m, d6 = nominal_[5].d_m;
  const Eigen::Matrix3d rotation = base_from_flange.linear();
  const Eigen::Vector3d flange = base_from_flange.translation();
  const Eigen::Vector3d wrist = flange - d6 * rotation.col(2);
  std::vector<Joints> solutions;

  // The wrist's centre stands d4 beside the plane of the arm: two shoulders.
  const double shoulder_rad = Acos(d4 / std::hypot(wrist.x(), wrist.y()));
  if (!std::isfinite(shoulder_rad)) return solutions;
  for (const double shoulder : {-1.0, 1.0}) {
    Joints q{};
    q[0] = std::atan2(wrist.y(), wrist.x()) + kPi / 2 + shoulder * shoulder_rad;
    const Eigen::Vector3d beside(std::sin(q[0]), -std::cos(q[0]), 0);

    // The tool's axis against the plane of the arm: two wrists.
    const double wrist_rad = Acos((flange.dot(beside) - d4) / d6);
    if (!std::isfinite(wrist_rad)) continue;
    for (const double flip : {-1.0, 1.0}) {
      q[4] = flip * wrist_rad;
      const double s5 = std::sin(q[4]);
      const Eigen::Vector3d beside_in_flange = rotation.transpose() * beside;
      q[5] = std::abs(s5) < kSingular ? near[5]
                                      : std::atan2(-beside_in_flange.y() / s5, beside_in_flange.x() / s5);

      // What is left is an arm of two links in its plane: two elbows.
      const Eigen::Isometry3d shoulder_from_wrist1 =
          Link(nominal_[0], q[0]).inverse() * base_from_flange *
          (Link(nominal_[4], q[4]) * Link(nominal_[5], q[5])).inverse();
      const double x = shoulder_from_wrist1(0, 3), y = shoulder_from_wrist1(1, 3);
      const double elbow_rad = Acos((x * x + y * y - a2 * a2 - a3 * a3) / (2 * a2 * a3));
      if (!std::isfinite(elbow_rad)) continue;
      for (const double elbow : {-1.0, 1.0}) {
        q[2] = elbow * elbow_rad;
        q[1] = std::atan2(y, x) - std::atan2(a3 * std::sin(q[2]), a2 + a3 * std::cos(q[2]));
        q[3] = std::atan2(shoulder_from_wrist1(1, 0), shoulder_from_wrist1(0, 0)) - q[1] - q[2];
        Joints solution = q;
        for (size_t i = 0; i < 6; ++i) solution[i] = Near(solution[i], near[i]);
        solutions.push_back(solution);
      }
    }
  }
  std::sort(solutions.begin(), solutions.end(),
            [&](const Joints& a, const Joints& b) { return Farthest(a, near) < Farthest(b, near); });
  return solutions;
}

bool UrKinematics::Refine(const Eigen::Isometry3d& base_from_flange, Joints* joints) const {
  constexpr int kSteps = 8;
  constexpr double kStepRad = 1e-6;
  for (int step = 0; step < kSteps; ++step) {
    const auto error_of = [&](const Joints& q) {
      const Eigen::Isometry3d flange_from_wanted = Chain(table_, q).inverse() * base_from_flange;
      const Eigen::AngleAxisd turn(flange_from_wanted.linear());
      Eigen::Matrix<double, 6, 1> error;
      error << flange_from_wanted.translation(), turn.angle() * turn.axis();
      return error;
    };
    const Eigen::Matrix<double, 6, 1> error = error_of(*joints);
    if (error.norm() < 1e-10) return true;
    Eigen::Matrix<double, 6, 6> slope;
    for (size_t i = 0; i < 6; ++i) {
      Joints moved = *joints;
      moved[i] += kStepRad;
      slope.col(static_cast<Eigen::Index>(i)) = (error_of(moved) - error) / kStepRad;
    }
    const Eigen::Matrix<double, 6, 1> change = slope.fullPivLu().solve(-error);
    if (!change.allFinite() || change.cwiseAbs().maxCoeff() > 0.5) return false;
    for (size_t i = 0; i < 6; ++i) (*joints)[i] += change[static_cast<Eigen::Index>(i)];
  }
  return (Chain(table_, *joints).inverse() * base_from_flange).translation().norm() < 1e-6;
}

}  // namespace touchstone::gateway::arm
