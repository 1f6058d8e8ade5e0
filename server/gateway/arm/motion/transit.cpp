#include "server/gateway/arm/motion/transit.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/gateway/arm/motion/line_turn.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kSamePlaceM = 1e-4, kSameTurnRad = 1e-3;
constexpr double kLevel = 0.3;  // a tool whose axis falls less than this goes straight up instead

bool SamePose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.translation() - b.translation()).norm() < kSamePlaceM && TurnRad(a, b) < kSameTurnRad;
}

// The pose lifted to the plane, along its own axis.
Eigen::Isometry3d Lifted(Eigen::Isometry3d pose, double plane_m) {
  const double rise_m = plane_m - pose.translation().z();
  if (rise_m <= kSamePlaceM) return pose;
  const Eigen::Vector3d axis = pose.linear().col(2);
  if (axis.z() > -kLevel)
    pose.translation().z() += rise_m;
  else
    pose.translation() += rise_m / axis.z() * axis;
  return pose;
}

}  // namespace

std::vector<Eigen::Isometry3d> TransitPath::Poses(int turn) const {
  if (turn == 0 && SamePose(from, to)) return {to};
  // Tilted, an outer finger is lower than the middle one. No start is crossed below its own height.
  const double hang_m =
      outermost_finger_m * std::max(std::abs(from.linear()(2, 0)), std::abs(to.linear()(2, 0)));
  const double height_m =
      std::max({plane_m + hang_m, to.translation().z(), turn != 0 ? from.translation().z() : 0.0});
  const Eigen::Isometry3d out = Lifted(from, height_m), in = Lifted(to, height_m);
  std::vector<Eigen::Isometry3d> poses = {out};

  // The longer turn, in thirds: the tilt changes evenly while the tool turns about its own axis.
  const Eigen::Quaterniond change(out.linear().transpose() * in.linear());
  const double short_rad = std::remainder(2 * std::atan2(change.z(), change.w()), 2 * kPi);
  if (turn * short_rad < 0) {
    const double whole_rad = short_rad + turn * 2 * kPi;
    const Eigen::Quaterniond twist(Eigen::AngleAxisd(short_rad, Eigen::Vector3d::UnitZ()));
    const Eigen::Quaterniond swing = change * twist.conjugate();
    for (const double part : {1 / 3.0, 2 / 3.0}) {
      Eigen::Isometry3d between = out;
      between.translation() += part * (in.translation() - out.translation());
      between.linear() = out.linear() * Eigen::Quaterniond::Identity().slerp(part, swing).toRotationMatrix() *
                         Eigen::AngleAxisd(part * whole_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      poses.push_back(between);
    }
  }
  poses.push_back(in);
  poses.push_back(to);

  // Lines of no length are left out.
  std::vector<Eigen::Isometry3d> kept;
  for (const Eigen::Isometry3d& pose : poses)
    if (!SamePose(kept.empty() ? from : kept.back(), pose)) kept.push_back(pose);
  if (kept.empty() || !kept.back().isApprox(to)) {
    if (!kept.empty() && SamePose(kept.back(), to)) kept.pop_back();
    kept.push_back(to);
  }
  return SplitTurns(from, kept);
}

std::vector<Eigen::Isometry3d> RetractPath(const Eigen::Isometry3d& from, double back_m, double height_m) {
  std::vector<Eigen::Isometry3d> poses;
  const double rise_m = height_m - from.translation().z();
  if (rise_m <= kSamePlaceM) return poses;
  const Eigen::Vector3d axis = from.linear().col(2);
  if (axis.z() < -kLevel) back_m = std::min(back_m, rise_m / -axis.z());
  Eigen::Isometry3d pose = from;
  if (back_m > kSamePlaceM) {
    pose.translation() -= back_m * axis;
    poses.push_back(pose);
  }
  if (pose.translation().z() < height_m - kSamePlaceM) {
    pose.translation().z() = height_m;
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace touchstone::gateway::arm
